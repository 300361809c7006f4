import sys

from snakemake.utils import validate

sys.path.insert(0, f"{workflow.basedir}/scripts")
import cases as table
import report as summary

validate(config, "../schemas/config.schema.yaml")
OUT = config["output"]
CASE = f"{OUT}/cases/{{case}}/{{case}}"  # of a case's files the first part of their names
RECORD = f"{OUT}/records/{{case}}"
LOG = f"{OUT}/logs/{{case}}"
try:
    CASES = table.read(config["cases"])
except table.BadTable as error:
    raise WorkflowError(str(error))
REPORT = "report"
if config["shard"]:
    i, n = map(int, config["shard"].split("/"))
    if i > n:
        raise WorkflowError(f"shard: {i} of {n} is none; give I/N with I from 1 to N")
    CASES = dict(list(CASES.items())[i - 1 :: n])
    REPORT = f"report-{i}-of-{n}"


wildcard_constraints:
    case="[^/]+",


def row(wildcards):
    """Returns the row of a case. Of a case that has left the table nothing is made."""
    return CASES[wildcards.case]
