"""Ten cases in a loop. One of them is broken, and costs itself alone."""

import csv
import pathlib

import vgs

with open("cases.csv", "w", newline="") as table:
    rows = csv.writer(table)
    rows.writerow(["case", "splats", "psnr_db", "p99_hu", "error"])
    for path in sorted(pathlib.Path("cases").glob("*.nii.gz")):
        try:
            ct = vgs.read(path)
            splats = vgs.fit(ct, (226, 3071), quality="preview", progress=False)
            found = splats.evaluate(ct, (226, 3071))
            rows.writerow([path.name, len(splats), found.psnr_db, found.p99_hu, ""])
        except vgs.Error as error:
            rows.writerow([path.name, "", "", "", error.code])
            print(error)
