"""Runs the cases through vgs and tells what becomes of each."""

import collections
import json
import os
import queue
import re
import subprocess
import threading

import numpy as np

from case import Grid

# A small file that takes longer hangs.
SECONDS = 30


class Vgs:
    """The program `voxels`, which reads volumes as vgs does: one process for all."""

    def __init__(self, program):
        self.program = program
        self.start()

    def start(self):
        self.process = subprocess.Popen(
            [self.program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self.lines = queue.Queue()
        threading.Thread(target=self.listen, args=[self.process, self.lines], daemon=True).start()

    @staticmethod
    def listen(process, lines):
        for line in process.stdout:
            lines.put(line)
        lines.put(None)

    def ask(self, path, out, options):
        """Returns the answer for a file, with its grid where it was read; after a crash or a hang a new process is
        started."""
        asked = {"path": str(path), "out": str(out)} | options
        print(json.dumps(asked), file=self.process.stdin, flush=True)
        try:
            line = self.lines.get(timeout=SECONDS)
        except queue.Empty:
            line = None
        if line is None:
            hung = self.process.poll() is None
            self.close()
            self.start()
            return {"panic": f"nothing within {SECONDS} s" if hung else "the program ended", "warnings": []}
        answer = json.loads(line)
        if "size" in answer:
            values = np.fromfile(out, "<f4").reshape(answer["size"], order="F")
            answer["grid"] = Grid(values, np.array([*answer["affine"], [0, 0, 0, 1]]), answer["oriented"])
            out.unlink()
        return answer

    def close(self):
        self.process.kill()
        self.process.wait()


Outcome = collections.namedtuple("Outcome", "what told")


def judge(case, answer):
    """Returns what became of a case: equal, refused, or wrong with what is wrong."""
    warnings = "\n".join(answer["warnings"])
    if "panic" in answer:
        return Outcome("wrong", f"crashed or hung: {answer['panic']}")
    if "code" in answer:
        told = f"{answer['code']} (exit {answer['exit']}): {answer['message']} [{answer['help']}]"
        if case.odd is None:
            return Outcome("wrong", f"refused, although nothing is odd: {told}")
        if not re.search(case.odd, f"{answer['message']} {answer['help']} {warnings}"):
            return Outcome("wrong", f"refused without the name of what is odd ({case.odd}): {told}")
        return Outcome("refused", told)
    if case.truth is None:
        return Outcome(
            "wrong",
            f"read, although it has no right value (it should be refused by the name of {case.odd}); "
            f"warnings: {warnings or 'none'}",
        )
    difference = answer["grid"].difference(case.truth)
    if difference:
        return Outcome("wrong", f"{difference}; warnings: {warnings or 'none'}")
    if answer["oriented"] != case.truth.oriented and "volume" not in case.options:
        return Outcome("wrong", f"orientation is {'' if answer['oriented'] else 'not '}known, which is not so")
    if case.warns and not re.search(case.warns, warnings):
        return Outcome(
            "wrong", f"read rightly, without a word of what is odd ({case.warns}); warnings: {warnings or 'none'}"
        )
    return Outcome("equal", warnings)


def confirm(case, path):
    """Returns what each outsider says of the truth of a case: None if it agrees, else how it differs. They run in a
    process of their own, since some end it."""
    reader, writer = os.pipe()
    if child := os.fork():
        os.close(writer)
        with open(reader) as pipe:
            told = pipe.read()
        os.waitpid(child, 0)
        return json.loads(told) if told else {name: "does not read it: crashes" for name in case.readers}
    os.close(reader)
    with open(writer, "w") as pipe:
        json.dump({name: read and opinion(read, case, path) for name, read in case.readers.items()}, pipe)
    os._exit(0)


def opinion(read, case, path):
    try:
        grid = read(path)
    except Exception as e:  # Whatever an outsider raises, it does not read the file.
        return f"does not read it: {type(e).__name__}: {e}".replace("\n", " ")[:200]
    return grid.difference(case.truth)
