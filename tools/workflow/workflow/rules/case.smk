# The steps of a case. What Snakemake sees of a step is its record, a small JSON file (scripts/step.py). The files of vgs are
# no declared outputs: Snakemake removes those of a job that fails, and with them what a fit is taken up from. A case that vgs
# refuses is a record, too, and no failed job: in a group of cases, as clusters have them, one failed job would stop the others
# and remove what they have declared. Every step asks for the device, so that those of a group are planned one by one.


rule fit:
    input:
        scan=lambda wildcards: table.files(row(wildcards)),
    output:
        f"{RECORD}/fit.json",
    log:
        f"{LOG}/fit.log",
    params:
        command=lambda wildcards: [
            *("fit", *table.flags(row(wildcards), config["fit"])),
            *("--no-eval", f"--output={CASE}.ply".format(case=wildcards.case)),
        ],
        writes=[f"{CASE}.ply"],
    group:
        "case"
    threads: 2
    resources:
        device=1,
        runtime=config["minutes-per-fit"],
    script:
        "../scripts/step.py"


rule small:
    input:
        before=[f"{RECORD}/fit.json"],
    output:
        f"{RECORD}/small.json",
    log:
        f"{LOG}/small.log",
    params:
        command=["convert", f"{CASE}.ply", f"--output={CASE}.vgs"],
        writes=[f"{CASE}.vgs"],
    group:
        "case"
    resources:
        device=1,
        runtime=1,
    script:
        "../scripts/step.py"


# The small file is what is kept and sent: it is what is measured, drawn and made a page of.
rule evaluate:
    input:
        before=[f"{RECORD}/small.json"],
    output:
        f"{RECORD}/evaluate.json",
    log:
        f"{LOG}/evaluate.log",
    params:
        command=lambda wildcards: [
            *("eval", f"{CASE}.vgs".format(case=wildcards.case)),
            *table.flags(row(wildcards), config["fit"], table.READING),
            f"--picture={CASE}-error.png".format(case=wildcards.case),
        ],
        writes=[f"{CASE}-error.png"],
    group:
        "case"
    threads: 2
    resources:
        device=1,
        runtime=2,
    script:
        "../scripts/step.py"


rule picture:
    input:
        before=[f"{RECORD}/small.json"],
    output:
        f"{RECORD}/picture.json",
    log:
        f"{LOG}/picture.log",
    params:
        command=["render", f"{CASE}.vgs", f"--output={CASE}.png", *table.arguments(config["render"])],
        writes=[f"{CASE}.png"],
    group:
        "case"
    resources:
        device=1,
        runtime=1,
    script:
        "../scripts/step.py"


rule page:
    input:
        before=[f"{RECORD}/small.json"],
    output:
        f"{RECORD}/page.json",
    log:
        f"{LOG}/page.log",
    params:
        command=["convert", f"{CASE}.vgs", f"--output={CASE}.html", "--title={case}"],
        writes=[f"{CASE}.html"],
    group:
        "case"
    resources:
        device=1,
        runtime=1,
    script:
        "../scripts/step.py"
