"""The report of a cohort: a page that needs no network, and its table as CSV."""

import base64
import csv
import html
import io
import json
import math
import pathlib
import string
import urllib.parse

import PIL.Image

STEPS = ["fit", "small", "evaluate", "picture", "page"]
# Columns of numbers: heading, name in the CSV, step, path in its record, factor, decimals.
COLUMNS = [
    ("Region, voxels", "voxels", "fit", "results.roi_voxels", 1, 0),
    ("Splats", "splats", "fit", "results.splats", 1, 0),
    ("PSNR, dB", "psnr_db", "evaluate", "results.psnr_db", 1, 1),
    ("RMS error, HU", "rmse_hu", "evaluate", "results.rmse_hu", 1, 1),
    ("99 % within, HU", "p99_hu", "evaluate", "results.p99_hu", 1, 1),
    ("Worst voxel, HU", "worst_hu", "evaluate", "results.errors.region.worst_hu", 1, 0),
    ("Small file, kB", "small_file_kb", "small", "results.bytes", 1e-3, 1),
    ("Fit, s", "fit_s", "fit", "results.seconds", 1, 1),
    ("Host memory, MB", "host_mb", "fit", "results.host_peak_bytes", 1e-6, 0),
    ("Device memory, MB", "device_mb", "fit", "results.device_peak_bytes", 1e-6, 0),
]
PLOTS = [
    ("p99_hu", "Error that 99 % of the voxels stay within", "HU"),
    ("small_file_kb", "Size of the small file", "kB"),
    ("fit_s", "Time of the fit", "s"),
]
FILES = [("page", "{}.html"), ("picture", "{}.png"), ("error", "{}-error.png"), (".vgs", "{}.vgs")]
WIDTH, HEIGHT, MARGIN = 360, 120, 20


def write(output, name, cases, worst):
    """Writes the report of a folder of outputs, NAME.html and NAME.csv. Returns the number of cases that are not whole."""
    output = pathlib.Path(output)
    output.mkdir(parents=True, exist_ok=True)
    rows = [_row(output, case) for case in cases]
    counts = {state: sum(row["state"] == state for row in rows) for state in ("done", "failed", "unfinished")}
    known = [row for row in rows if row["p99_hu"] is not None]
    known.sort(key=lambda row: -row["p99_hu"])
    total = sum(row["small_file_kb"] or 0 for row in rows), sum(row["fit_s"] or 0 for row in rows)
    template = string.Template(pathlib.Path(__file__).with_name("report.html").read_text(encoding="utf-8"))
    page = template.substitute(
        summary=f"<b>{len(rows)}</b> cases: <b>{counts['done']}</b> done, <b>{counts['failed']}</b> failed, "
        f"<b>{counts['unfinished']}</b> unfinished. Small files: {_number(total[0] / 1000, 2)} MB; fits: "
        f"{_number(total[1] / 60, 1)} min.",
        broken=_broken(rows),
        plots="".join(_plot(known, *plot) for plot in PLOTS),
        worst="".join(_worst(output, row) for row in known[:worst]),
        headings="".join(_heading(title, i > 1) for i, title in enumerate(["Case", "State", *[c[0] for c in COLUMNS]])),
        rows="".join(_table_row(row) for row in rows),
    )
    _write(output / f"{name}.html", page)
    names = ["case", "state", *[column[1] for column in COLUMNS], "step", "code", "message", "help"]
    text = io.StringIO()
    table = csv.DictWriter(text, names, extrasaction="ignore")
    table.writeheader()
    table.writerows(rows)
    _write(output / f"{name}.csv", text.getvalue())
    return counts["failed"] + counts["unfinished"]


def _write(path, text):
    new = path.with_name(path.name + ".new")
    new.write_text(text, encoding="utf-8")
    new.replace(path)


def _row(output, case):
    """Returns what is known of a case: its state, the numbers of the columns and, if a step failed, its error."""
    records = {}
    for step in STEPS:
        path = output / "records" / case / f"{step}.json"
        records[step] = json.loads(path.read_text()) if path.exists() else {"state": "unfinished"}
    states = [record["state"] for record in records.values()]
    row = {"case": case, "state": next((s for s in ("failed", "unfinished") if s in states), "done")}
    for _, name, step, path, factor, _ in COLUMNS:
        value = records[step]
        for key in path.split("."):
            value = (value or {}).get(key)
        row[name] = None if value is None else value * factor
    for step, record in records.items():
        if record["state"] == "failed":
            error = record["error"] or {}
            row |= {"step": step, "code": error.get("code"), "message": error.get("msg"), "help": error.get("help")}
            row["message"] = f"{error['file']}: {row['message']}" if error.get("file") else row["message"]
            break
        if record["state"] == "unfinished":
            row |= {"step": step, "message": f"not done; see logs/{case}/{step}.log", "help": "run the workflow again"}
            break
    return row


def _number(value, decimals):
    return "" if value is None else f"{value:,.{decimals}f}"


def _link(case, file):
    return f'href="cases/{urllib.parse.quote(case)}/{urllib.parse.quote(file.format(case))}"'


def _anchor(case):
    return html.escape("case-" + urllib.parse.quote(case, safe=""))


def _heading(title, is_number):
    kind = ' class="number"' if is_number else ""
    return f'<th scope="col"{kind} aria-sort="none"><button type="button">{html.escape(title)}</button></th>'


def _table_row(row):
    cells = [f'<th scope="row">{html.escape(row["case"])}</th>', f'<td class="{row["state"]}">{row["state"]}</td>']
    for _, name, _, _, _, decimals in COLUMNS:
        value = row[name]
        sort = "" if value is None else f' data-sort="{value!r}"'
        cells.append(f'<td class="number"{sort}>{_number(value, decimals) or "–"}</td>')
    links = [f"<a {_link(row['case'], file)}>{title}</a>" for title, file in FILES] if row["state"] == "done" else []
    return f'<tr id="{_anchor(row["case"])}">{"".join(cells)}<td>{" · ".join(links)}</td></tr>\n'


def _broken(rows):
    """Returns the section of the cases that are not whole, or nothing."""
    items = []
    for row in rows:
        if row["state"] != "done":
            code = f" <code>{html.escape(row['code'])}</code>" if row.get("code") else ""
            items.append(
                f"<li><b>{html.escape(row['case'])}</b>, {row['state']} at {row['step']}{code}: "
                f"{html.escape(row.get('message') or '')}. <em>{html.escape(row.get('help') or '')}</em></li>\n"
            )
    return f"<h2>Failed and unfinished</h2>\n<ul class=broken>\n{''.join(items)}</ul>" if items else ""


def _worst(output, row):
    """Returns the card of a case with its error picture, made small enough for many of them in one file."""
    path = output / "cases" / row["case"] / f"{row['case']}-error.png"
    if not path.exists():
        return ""
    with PIL.Image.open(path) as picture:
        picture = picture.convert("RGB")
        picture.thumbnail((800, 1600))
        data = io.BytesIO()
        picture.save(data, "WEBP", quality=80)
    name = html.escape(row["case"])
    return (
        f"<figure><a {_link(row['case'], '{}-error.png')}><img loading=lazy width={picture.width} "
        f'height={picture.height} alt="Slices and views of {name}: CT, splats, difference" '
        f'src="data:image/webp;base64,{base64.b64encode(data.getvalue()).decode()}"></a>'
        f'<figcaption><a href="#{_anchor(row["case"])}">{name}</a>: 99 % of the voxels within '
        f"{row['p99_hu']:.1f} HU, the worst {_number(row['worst_hu'], 0)} HU off</figcaption></figure>\n"
    )


def _ticks(low, high, is_log):
    """Returns round numbers that span a range."""
    if is_log:
        decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        every = [m * 10.0**k for k in decades for m in ((1, 3) if len(decades) < 5 else (1,))]
        inner = [tick for tick in every if low < tick < high]
        return [max((t for t in every if t <= low), default=low), *inner, min(t for t in every if t >= high)]
    step = 10 ** math.floor(math.log10((high - low) / 3))
    step *= next(m for m in (1, 2, 5, 10) if (high - low) / (m * step) <= 5)
    return [step * k for k in range(math.floor(low / step), math.ceil(high / step) + 1)]


def _plot(rows, name, title, unit):
    """Returns a plot of dots, one a case, that pile up where values are alike."""
    values = sorted((row[name], row["case"]) for row in rows if row[name] is not None)
    if not values:
        return ""
    low, high = values[0][0], values[-1][0]
    is_log = low > 0 and high > 20 * low
    if high - low < 1e-6 * abs(high):
        low, high = low - (abs(low) or 1) / 2, high + (abs(high) or 1) / 2
    ticks = _ticks(low, high, is_log)
    scale = math.log if is_log else float

    def place(value):
        share = (scale(value) - scale(ticks[0])) / (scale(ticks[-1]) - scale(ticks[0]))
        return MARGIN + share * (WIDTH - 2 * MARGIN)

    bins = {}
    for value, case in values:
        bins.setdefault(round(place(value) / 7), []).append((value, case))
    floor = HEIGHT - 24
    rise = min(7.0, (floor - 14) / max(len(found) for found in bins.values()))
    dots = "".join(
        f'<a href="#{_anchor(case)}"><circle cx="{bin * 7}" cy="{floor - 5 - i * rise:.1f}" r="3">'
        f"<title>{html.escape(case)}: {_number(value, 1)} {unit}</title></circle></a>"
        for bin, found in bins.items()
        for i, (value, case) in enumerate(found)
    )
    axis = "".join(
        f'<path d="M{place(tick):.1f} {floor}v4"/><text x="{place(tick):.1f}" y="{HEIGHT - 6}">{tick:,.6g}</text>'
        for tick in ticks
    )
    median = sorted(value for value, _ in values)[len(values) // 2]
    return (
        f"<figure class=plot><figcaption>{title}, {unit}<br><small>median {_number(median, 1)} {unit}"
        f"{'; logarithmic' if is_log else ''}</small></figcaption>"
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{title}: {len(values)} cases from '
        f'{_number(values[0][0], 1)} to {_number(values[-1][0], 1)} {unit}, median {_number(median, 1)} {unit}">'
        f'<path class=median d="M{place(median):.1f} 4V{floor}"/><path d="M{MARGIN} {floor}H{WIDTH - MARGIN}"/>{axis}{dots}'
        "</svg></figure>\n"
    )
