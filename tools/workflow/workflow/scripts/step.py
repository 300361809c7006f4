"""Runs one step of a case, a command of vgs, and writes its record, a JSON file:

    state     done, failed (vgs refused the case for its data or flags) or skipped (the step before was not done)
    exit      exit code of vgs; error: code, message and help of its error
    results   what vgs --json printed
    bytes     sizes of the files that the step wrote
    resumed   whether a fit was taken up where it had been stopped
    made_of   hash of the version of vgs, the flags and the inputs

What is no fault of the case (no device, no memory, a full disk, a signal) leaves no record: the job fails, and the next run
of the workflow does it again. Only shortage, exit code 75, is tried again here, after a while.
"""

import contextlib
import fcntl
import getpass
import hashlib
import json
import os
import pathlib
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time

# Exit codes (vgs explain) that a case has of itself: wrong flags, nothing to do, unusable or missing input.
OF_THE_CASE = {2, 3, 65, 66}
SHORTAGE = 75


@contextlib.contextmanager
def device():
    """Waits until no other step of this job of the cluster, or of this machine, has the device."""
    name = f"vgs-{getpass.getuser()}-{os.environ.get('SLURM_JOB_ID', 'local')}.lock"
    with open(pathlib.Path(tempfile.gettempdir()) / name, "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def run(command, log):
    """Runs vgs. Returns its exit code, its results and its last error."""
    error, results = None, None
    with tempfile.TemporaryFile("w+") as out:
        with subprocess.Popen([*command, "--json"], stdout=out, stderr=subprocess.PIPE, encoding="utf-8") as process:
            for line in process.stderr:
                log.write(line)
                log.flush()
                if line.startswith('{"level":"error"'):
                    error = {name: value for name, value in json.loads(line).items() if name != "level"}
        out.seek(0)
        if process.returncode == 0:
            results = json.load(out)
    return process.returncode, results, error


def fingerprint(*parts, files):
    """Returns a hash of what a step is made of, of files their size and time."""
    stats = [(path, (stat := pathlib.Path(path).stat()).st_size, stat.st_mtime_ns) for path in files]
    return hashlib.sha256(json.dumps([*parts, stats]).encode()).hexdigest()


def step(vgs, command, writes, made_of, log, config):
    """Does a step. Returns its record, or the exit code of vgs where that is no fault of the case."""
    main = writes[0]
    main.parent.mkdir(parents=True, exist_ok=True)
    kept, begun = (main.with_name(f".{main.name}.{what}") for what in ("done", "begun"))
    # Snakemake removes the records of a whole group if one of its jobs fails: what was done is known by this copy.
    if kept.exists() and all(path.exists() for path in writes):
        record = json.loads(kept.read_text())
        if record["made_of"] == made_of:
            return record
    is_fit = command[0] == "fit"
    states = [main.with_suffix(end) for end in (".state", ".previous.state")]
    if not (begun.exists() and begun.read_text() == made_of):
        # What another fit has left is neither taken up nor taken for done.
        for path in [kept, *writes, *states]:
            path.unlink(missing_ok=True)
        begun.write_text(made_of)
    start, resumed = time.monotonic(), False
    for attempt in range(1, config["retries"] + 2):
        flags = ["--force"]
        if is_fit:
            flags = [f"--checkpoint-every={config['checkpoint-every']}", "--checkpoint-keep=1", *flags]
            if any(state.exists() for state in states):
                flags[-1], resumed = "--resume", True
        with contextlib.nullcontext() if command[0] == "convert" else device():
            code, results, error = run([*vgs, *command, *flags], log)
        if code != SHORTAGE or attempt > config["retries"]:
            break
        log.write(f"workflow: shortage, exit code 75, at attempt {attempt}\n")
        log.flush()
        time.sleep(config["retry-wait-seconds"])
    if code and code not in OF_THE_CASE:
        return code
    begun.unlink()
    if is_fit:
        for path in main.parent.iterdir():
            if re.fullmatch(re.escape(main.stem) + r"\.\d+\.ply", path.name):
                path.unlink()
    record = {
        "state": "failed" if code else "done",
        "exit": code,
        "error": error,
        "results": results,
        "bytes": {} if code else {path.name: path.stat().st_size for path in writes},
        "seconds": time.monotonic() - start,
        "attempts": attempt,
        "resumed": resumed,
        "made_of": made_of,
    }
    if not code:
        write(kept, record)
    return record


def write(path, record):
    """Writes a record whole or not at all."""
    new = path.with_name(path.name + ".new")
    new.write_text(json.dumps(record, indent=1))
    new.replace(path)


def main(job):
    # A stop is for vgs, which gets the signal, too, and saves what it has: this script waits for that.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)
    config, output, command = job.config, pathlib.Path(job.output[0]), list(job.params.command)
    records = [json.loads(pathlib.Path(path).read_text()) for path in job.input.get("before", [])]
    if any(record["state"] != "done" for record in records):
        write(output, {"state": "skipped"})
        return 0
    vgs = shlex.split(config["vgs"])
    if config["device"] != "" and command[0] != "convert":
        command.append(f"--device={config['device']}")
    with open(job.log[0], "w", encoding="utf-8") as log:
        try:
            version = subprocess.run([*vgs, "--version"], capture_output=True, text=True, check=True).stdout
        except (OSError, subprocess.CalledProcessError) as error:
            message = f"vgs cannot be run; how it is called is the setting vgs, {config['vgs']!r}: {error}"
            print(message, file=log)
            print(message, file=sys.stderr)
            return 1
        made_of = fingerprint(
            version, command, [record["made_of"] for record in records], files=job.input.get("scan", [])
        )
        record = step(vgs, command, [pathlib.Path(path) for path in job.params.writes], made_of, log, config)
    if isinstance(record, int):
        print(f"vgs {command[0]} ended with exit code {record}; see {job.log[0]}", file=sys.stderr)
        return 1
    write(output, record)
    return 0


if __name__ == "__main__":
    sys.exit(main(snakemake))  # noqa: F821
