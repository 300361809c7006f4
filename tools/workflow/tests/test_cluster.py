"""Shortage, and the profile for Slurm, with programs that stand in for vgs and for Slurm's."""

import json
import re
import stat

import pytest
from conftest import Cohort

SBATCH = """#!/bin/sh
# Runs what --wrap gives at once, as a job with a folder of its own, and says its number.
n=1
until mkdir {folder}/job-$n 2>/dev/null; do n=$((n + 1)); done
cd {folder}/job-$n
printf '%s\\n' "$@" >arguments
for argument; do case $argument in --wrap=*) wrap=${{argument#--wrap=}} ;; esac; done
(cd {cohort} && SLURM_JOB_ID=$n sh -c "$wrap") >said 2>&1 && state=COMPLETED || state=FAILED
echo "$n|$state" >state
echo $n
"""
SRUN = """#!/bin/sh
# Leaves out its own flags.
while case $1 in -*) true ;; *) false ;; esac; do shift; done
exec "$@"
"""


@pytest.fixture
def slurm(tmp_path):
    """A folder of Slurm's programs for PATH."""
    folder = tmp_path / "slurm"
    folder.mkdir()
    scripts = {
        "sbatch": SBATCH.format(folder=folder, cohort=tmp_path),
        "srun": SRUN,
        "sinfo": "#!/bin/sh\n",
        "scontrol": "#!/bin/sh\n",
    }
    scripts |= {name: f"#!/bin/sh\ncat {folder}/job-*/state\n" for name in ("sacct", "squeue")}
    scripts |= {"scancel": f"#!/bin/sh\necho $@ >>{folder}/cancelled\n", "sacctmgr": "#!/bin/sh\n"}
    for name, text in scripts.items():
        (folder / name).write_text(text)
        (folder / name).chmod(stat.S_IRWXU)
    return folder


def cohort(tmp_path, stand_in, plan, count=6):
    """Cases of which the stand-in for vgs ends with the exit codes of a plan."""
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    for i in range(count):
        (tmp_path / f"{i}.nii").write_text("")
    made = Cohort(tmp_path, stand_in)
    made.table(*(f"case {i},{i}.nii,{i}.nii" for i in range(count)))
    return made


def fits(tmp_path, i):
    return (tmp_path / "calls").read_text().count(f"fit {i}.nii ")


def test_only_shortage_is_tried_again(stand_in, tmp_path):
    # Once short; short for good; no device; of the case's own; a signal; done.
    plan = {"0.nii": [75], "1.nii": [75] * 9, "2.nii": [69] * 9, "3.nii": [65] * 9, "4.nii": [143] * 9}
    made = cohort(tmp_path, stand_in, plan)
    made.settings["retries"] = 2
    code, said = made.run()
    assert code == 1
    assert [fits(tmp_path, i) for i in range(6)] == [2, 3, 1, 1, 1, 1], said
    assert made.record("case 0", "fit")["attempts"] == 2
    assert made.record("case 3", "fit")["state"] == "failed"
    # What is no fault of the case has no record, so that the next run does it again.
    for i in (1, 2, 4):
        assert not (tmp_path / f"results/records/case {i}/fit.json").exists()
    assert "<b>2</b> done, <b>1</b> failed, <b>3</b> unfinished" in made.report()
    (tmp_path / "plan.json").write_text("{}")
    made.run()
    assert [fits(tmp_path, i) for i in range(6)] == [2, 4, 2, 1, 2, 1], "done and broken cases are left alone"
    assert "<b>5</b> done, <b>1</b> failed, <b>0</b> unfinished" in made.report()


def states(slurm):
    return [path.read_text().strip().split("|")[1] for path in sorted(slurm.glob("job-*/state"))]


def submit(made, slurm, *flags):
    flags = [*flags, "--slurm-init-seconds-before-status-checks", "1", "--latency-wait", "5"]
    return made.run(*flags, profile="slurm", path=slurm)


def test_slurm_gets_groups_of_cases_with_a_gpu_each(stand_in, slurm, tmp_path):
    made = cohort(tmp_path, stand_in, {"1.nii": [65]})
    code, said = submit(made, slurm, "--group-components", "case=3")
    assert code == 1, said
    assert "<b>5</b> done, <b>1</b> failed, <b>0</b> unfinished" in made.report(), said
    jobs = [path.read_text() for path in slurm.glob("job-*/arguments")]
    assert len(jobs) == 2, "six cases in groups of three"
    for job in jobs:
        assert "\n--gres=gpu:1\n" in job and "\n--cpus-per-task=2\n" in job and "\n--mem\n8000\n" in job
        assert re.search(r"^-t\n(\d+)$", job, re.M)[1] == "45", "the time of three cases"
        assert len(set(re.findall(r"fit:case=case (\d)", job))) == 3
    assert states(slurm) == ["COMPLETED", "COMPLETED"]


def test_a_group_that_breaks_off_is_taken_up_without_what_was_done(stand_in, slurm, tmp_path):
    made = cohort(tmp_path, stand_in, {"fit 2": 143}, count=2)
    code, said = submit(made, slurm)
    assert code == 1 and states(slurm) == ["FAILED"], said
    code, said = made.run()
    assert code == 0 and "<b>2</b> done" in made.report(), said
    assert sorted(fits(tmp_path, i) for i in range(2)) == [1, 2]


def test_shards_share_the_cases_and_the_whole_has_the_report(stand_in, tmp_path):
    made = cohort(tmp_path, stand_in, {}, count=3)
    made.settings |= {"cases": f"{tmp_path}/cases.csv", "output": f"{tmp_path}/results"}
    for i in (1, 2):
        code, said = made.run("--directory", f"pod-{i}", "--config", f"shard={i}/2")
        assert code == 0 and f"<b>{3 - i}</b> done" in made.report(f"report-{i}-of-2"), said
    code, said = made.run()
    assert code == 0 and "<b>3</b> done" in made.report(), said
    assert len((tmp_path / "calls").read_text().splitlines()) == 15, "each step of each case once"
