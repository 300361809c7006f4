"""In the place of vgs: writes the outputs that it is asked for at once, or ends with the exit codes that plan.json lists for
a volume, one after the other. Each call is a line of the file `calls`.

usage: stand_in.py FOLDER ARGUMENT...
"""

import json
import pathlib
import sys

folder, arguments = pathlib.Path(sys.argv[1]), sys.argv[2:]
if arguments == ["--version"]:
    sys.exit(print("vgs 0 (stand-in)"))
with open(folder / "calls", "a") as calls:
    calls.write(" ".join(arguments) + "\n")
if arguments[0] == "fit":
    before = (folder / "calls").read_text().count(f"fit {arguments[1]} ") - 1
    codes = json.loads((folder / "plan.json").read_text()).get(pathlib.Path(arguments[1]).name, [])
    if before < len(codes) and codes[before]:
        message = {"level": "error", "code": "VGS-GPU-010", "msg": "out", "help": "", "exit": codes[before]}
        print(json.dumps(message, separators=(",", ":")), file=sys.stderr)
        sys.exit(codes[before])
for argument in arguments:
    if argument.startswith(("--output=", "--picture=")):
        pathlib.Path(argument.split("=", 1)[1]).write_text("")
print("{}")
