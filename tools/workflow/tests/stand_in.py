"""In the place of vgs: writes the outputs that it is asked for at once. Or a fit ends with an exit code: plan.json has lists
of them for volumes, one after the other, and single ones for the n-th fit of all. Each call is a line of the file `calls`.

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
    plan = json.loads((folder / "plan.json").read_text())
    fits = [line.split()[1] for line in (folder / "calls").read_text().splitlines() if line.startswith("fit ")]
    codes = plan.get(arguments[1], [])
    code = plan.get(f"fit {len(fits)}") or dict(enumerate(codes, 1)).get(fits.count(arguments[1]))
    if code:
        message = {"level": "error", "code": "VGS-GPU-010", "msg": "out", "help": "", "exit": code}
        print(json.dumps(message, separators=(",", ":")), file=sys.stderr)
        sys.exit(code)
for argument in arguments:
    if argument.startswith(("--output=", "--picture=")):
        pathlib.Path(argument.split("=", 1)[1]).write_text("")
print("{}")
