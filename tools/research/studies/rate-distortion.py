#!/usr/bin/env python3
"""Measures rate and distortion: splats in .vgs and PLY beside volume codecs, of the voxels in a mask.

usage: rate-distortion.py DATA OUT.csv [CASE...]     adds rows; VGS is the command that runs vgs (tools/vgs)
       rate-distortion.py --plot OUT.csv OUT.svg
       rate-distortion.py --pictures DATA OUT.csv CASE...   lit pictures of splats and of the coded region, against the CT
       rate-distortion.py --table OUT.csv            a table at the sizes of some fits, and where the coded region overtakes them
       rate-distortion.py --coded|--splats DATA OUT.csv   the rows of the coder of the region, or of splats, anew

It needs numpy scipy nibabel h5py hdf5plugin imagecodecs matplotlib

All count the mask as vgs codes it, splats in their file. Codecs see the box around the mask, in which what is outside is
filled smoothly, or ("inside") the voxels of the mask alone, row by row; "coded" is the region without
splats, as `vgs convert --bound` writes it (STUDIES is the command that runs studies). Thick slices have none between
them. PSNR is over the range of the whole volume, at the voxels of the mask.
"""
import csv, json, lzma, os, subprocess, sys, tempfile
import h5py, hdf5plugin, imagecodecs, nibabel, numpy as np
from scipy.fft import dctn, idctn
from scipy.ndimage import map_coordinates

VGS = os.environ.get("VGS", "tools/vgs").split()
STUDIES = os.environ.get("STUDIES", "tools/run target/release/studies").split()
# Volume, mask (none: all of it), densities of splats.
CASES = {
    "torso bones": ("ct-torso-3mm/ct", "ct-torso-3mm/mask_bones", [0.0125, 0.025, 0.05, 0.1, 0.2]),
    "torso liver": ("ct-torso-3mm/ct", "ct-torso-3mm/mask_liver", [0.00625, 0.0125, 0.025, 0.05, 0.1]),
    "heart": ("ct-thorax-1p5mm/ct", "ct-thorax-1p5mm/mask_heart", [0.0125, 0.025, 0.05, 0.1]),
    "skull": ("ct-skull/ct", "ct-skull/mask_skull", [0.00625, 0.0125, 0.025, 0.05]),
    "abdomen bones": ("ct-abdomen-full/ct", "ct-abdomen-full/mask_bones", [0.00625, 0.0125, 0.025, 0.05, 0.1]),
    "engine": ("engine/volume", None, [0.0015625, 0.003125]),
}

LINES = {
    "lossless": ("black", "--"),
    "splats, .vgs": ("tab:red", "o-"),
    "splats, PLY": ("tab:red", "o:"),
    "coded": ("black", "D-"),
    "SZ3": ("tab:blue", "s-"),
    "SZ3, inside": ("tab:blue", "s--"),
    "zfp": ("tab:green", "^-"),
    "SPERR": ("tab:purple", "v-"),
    "DCT": ("tab:orange", "x-"),
    "JPEG-LS": ("tab:brown", "+-"),
    "JPEG XL": ("tab:pink", "1-"),
}


def xz(data):
    return len(lzma.compress(data, preset=9 | lzma.PRESET_EXTREME))


def through_hdf5(box, options):
    """Compresses and decompresses a box; returns its bytes in the file and what comes back."""
    with tempfile.NamedTemporaryFile(suffix=".h5") as file:
        with h5py.File(file.name, "w") as h5:
            h5.create_dataset("v", data=box, chunks=box.shape, **options)
        with h5py.File(file.name, "r") as h5:
            return h5["v"].id.get_storage_size(), h5["v"][...]


def through_dct(box, step):
    """Blocks of 8 voxels along each axis, their DCT in even steps, coefficients of one frequency together, xz."""
    padded = np.pad(box, [(0, -n % 8) for n in box.shape], mode="edge")
    x, y, z = (n // 8 for n in padded.shape)
    blocks = padded.reshape(x, 8, y, 8, z, 8).transpose(0, 2, 4, 1, 3, 5)
    codes = np.rint(dctn(blocks, axes=(3, 4, 5), norm="ortho") / step).astype(np.int32)
    frequency = np.add.outer(np.add.outer(np.arange(8), np.arange(8)), np.arange(8)).ravel()
    ordered = codes.reshape(-1, 512)[:, np.argsort(frequency, kind="stable")].T
    small = ordered.astype(np.int16)
    assert (small == ordered).all()
    # Low and high bytes apart.
    size = xz(small.astype("<i2").tobytes()) if abs(small).max() > 127 else xz(small.astype(np.int8).tobytes())
    back = idctn(codes * step, axes=(3, 4, 5), norm="ortho").transpose(0, 3, 1, 4, 2, 5).reshape(padded.shape)
    return size, back[tuple(slice(n) for n in box.shape)]


def by_slices(box, encode, decode):
    """Codes a box slice by slice, in whole numbers from its least one on; returns the bytes and what comes back."""
    low = np.floor(box.min())
    slices = [encode(np.ascontiguousarray(np.rint(box[:, :, z] - low).astype(np.uint16))) for z in range(box.shape[2])]
    back = np.stack([decode(data) for data in slices], axis=2).astype(np.float64) + low
    return sum(map(len, slices)), back.reshape(box.shape)


def coded(ct, region):
    """Returns what the near-lossless coder makes of a region, for each bound; it has the bytes of the mask, too."""
    flags = [] if region[0] == "--roi-threshold" else region
    command = [*STUDIES, "code", ct, *flags, "--bounds", "0,3,6,10,15,30,60,90,120,200,300"]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    return [json.loads(line) for line in lines if line.startswith("{")]


def lossless(box, inside):
    """Differences along the fastest axis, the voxels inside alone, low and high bytes apart, xz."""
    values = np.rint(box[inside]).astype(np.int64)
    steps = np.diff(values, prepend=0)
    folded = ((steps << 1) ^ (steps >> 63)).astype(np.uint16)
    return xz((folded & 255).astype(np.uint8).tobytes() + (folded >> 8).astype(np.uint8).tobytes())


def filled(box, inside):
    """Returns the box with what is outside filled from coarser and coarser means of what is inside."""
    weight = inside.astype(np.float64)
    if inside.all() or max(box.shape) == 1:
        return np.where(inside, box, np.sum(box * weight) / np.sum(weight))
    padded = [np.pad(a, [(0, n % 2) for n in box.shape]) for a in (box * weight, weight)]
    halves = tuple(n for size in padded[0].shape for n in (size // 2, 2))
    sums, weights = (a.reshape(halves).sum(axis=(1, 3, 5)) for a in padded)
    coarse = filled(sums / np.maximum(weights, 1e-9), weights > 0)
    places = np.meshgrid(*[(np.arange(n) - 0.5) / 2 for n in box.shape], indexing="ij", sparse=False)
    return np.where(inside, box, map_coordinates(coarse, places, order=1, mode="nearest"))


def run(*arguments):
    return subprocess.run([*VGS, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


def measure(name, data, write):
    ct, region, volume, mask, corner, box = read_case(name, data)
    span = float(volume.max() - volume.min())
    inside = mask[corner]
    alone = np.ascontiguousarray(volume[corner][inside])
    voxels = int(mask.sum())
    of_engine = coded(ct, region)
    of_mask = 0 if inside.all() else of_engine[0]["region_bytes"]

    def row(method, setting, size, psnr):
        write(dict(case=name, voxels=voxels, method=method, setting=setting, bytes=size, bytes_a_voxel=size / voxels,
                   psnr_db=psnr, mask_bytes=of_mask))

    def codec(method, setting, result):
        size, back = result
        error = (back[inside] if back.ndim == 3 else back).astype(np.float64) - alone
        mean = np.mean(error**2)
        row(method, setting, size + of_mask, 10 * np.log10(span**2 / mean) if mean else "")

    row("lossless", "xz", lossless(box, inside) + of_mask, "")
    for bound in (400, 250, 160, 100, 60, 40, 25, 16, 10, 6, 4):
        codec("SZ3", bound, through_hdf5(box, dict(hdf5plugin.SZ3(absolute=float(bound)))))
        codec("zfp", 4 * bound, through_hdf5(box, dict(hdf5plugin.Zfp(accuracy=4.0 * bound))))
        codec("SZ3, inside", bound, through_hdf5(alone, dict(hdf5plugin.SZ3(absolute=float(bound)))))
        codec("SPERR", bound, through_hdf5(box, dict(hdf5plugin.Sperr(absolute=float(bound)))))
    for step in (1200, 800, 500, 320, 200, 120, 80, 50, 30, 20):
        codec("DCT", step, through_dct(box, float(step)))
    for bound in (0, 2, 4, 8, 16, 30, 60):
        codec("JPEG-LS", bound, by_slices(box, lambda a: imagecodecs.jpegls_encode(a, level=bound), imagecodecs.jpegls_decode))
    for distance in (0.1, 0.3, 1, 2, 4, 8):
        encode = lambda a: imagecodecs.jpegxl_encode(a, distance=distance)
        codec("JPEG XL", distance, by_slices(box, encode, imagecodecs.jpegxl_decode))
    for of_bound in coded_rows(name, of_engine, span, inside.all()):
        write(of_bound)
    for fitted in splat_rows(name, ct, region, voxels, of_mask):
        write(fitted)


def splat_rows(name, ct, region, voxels, of_mask):
    """Returns rows of fits, in .vgs and as a PLY."""
    with tempfile.TemporaryDirectory() as scratch:
        for density in CASES[name][2]:
            for method, ending in (("splats, PLY", "ply"), ("splats, .vgs", "vgs")):
                path = f"{scratch}/a.{ending}"
                run("fit", ct, *region, "--density", density, "--between-slices", "linear", "--no-eval", "-q", "--force",
                    "-o", path)
                found = json.loads(run("eval", path, ct, *region, "--offsets", 0, "--json"))
                size = os.path.getsize(path)
                yield dict(case=name, voxels=voxels, method=method, setting=found["splats"], bytes=size,
                           bytes_a_voxel=size / voxels, psnr_db=found["psnr_db"], mask_bytes=of_mask)


def read_case(name, data):
    """Returns the path of the volume, the flags of the region, the volume, the mask, its box, and what is in that."""
    volume_name, mask_name, _ = CASES[name]
    ct, roi = (f"{data}/{file}.nii.gz" for file in (volume_name, mask_name))
    volume = np.asarray(nibabel.load(ct).dataobj, dtype=np.float32)
    if mask_name is None:
        region, mask = ["--roi-threshold", f"{volume.min()},{volume.max()}"], np.ones(volume.shape, dtype=bool)
    else:
        region, mask = ["--roi", roi], np.asarray(nibabel.load(roi).dataobj) > 0.5
    corner = tuple(slice(int(axis.min()), int(axis.max()) + 1) for axis in np.nonzero(mask))
    box = np.ascontiguousarray(filled(volume[corner].astype(np.float64), mask[corner]).astype(np.float32))
    return ct, region, volume, mask, corner, box


def anew(data, table, methods, rows_of):
    """Replaces the rows of some methods."""
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    fields = list(rows[0])
    kept = [row for row in rows if row["method"] not in methods]
    for name in CASES:
        kept += rows_of(name, *read_case(name, data))
        print(name, flush=True)
    order = list(dict.fromkeys(row["case"] for row in rows))
    kept.sort(key=lambda row: order.index(row["case"]))
    with open(table, "w", newline="") as file:
        writer = csv.DictWriter(file, fields)
        writer.writeheader()
        writer.writerows(kept)


def of_coder(name, ct, region, volume, mask, *_):
    return coded_rows(name, coded(ct, region), float(volume.max() - volume.min()), mask.all())


def of_splats(name, ct, region, volume, mask, *_):
    of_mask = 0 if mask.all() else coded(ct, region)[0]["region_bytes"]
    return splat_rows(name, ct, region, int(mask.sum()), of_mask)


def coded_rows(name, of_engine, span, is_whole):
    """Returns rows of what the engine's coder takes; a region that is the whole volume has no mask."""
    for found in of_engine:
        of_mask = 0 if is_whole else found["region_bytes"]
        size, voxels = found["value_bytes"] + of_mask, found["voxels"]
        psnr = 10 * np.log10(span**2 / found["rmse"] ** 2) if found["rmse"] else ""
        yield dict(case=name, voxels=voxels, method="coded", setting=found["bound"], bytes=size,
                   bytes_a_voxel=size / voxels, psnr_db=psnr, mask_bytes=of_mask)


def pictures(data, out, *names):
    """Writes the PSNR of lit pictures from four sides, of a few fits and of the coded region at several bounds."""
    with tempfile.TemporaryDirectory() as scratch, open(out, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["case", "function", "form", "splats or bound", "bytes", "psnr_db"])
        for name in names:
            ct, region, _, _, corner, _ = read_case(name, data)
            flags = [ct, *region]
            cameras, files = four_sides(nibabel.load(ct).affine, corner, scratch), []
            for density in CASES[name][2][:4]:
                path = f"{scratch}/{density}.vgs"
                run("fit", *flags, "--density", density, "--between-slices", "linear", "--no-eval", "-q", "--force", "-o", path)
                files.append(("splats", json.loads(run("info", path, "--json"))["splats"], path))
            for bound in (10, 15, 20, 30, 45, 60, 90, 120, 160, 200, 300):
                path = f"{scratch}/bound.{bound}.vgs"
                run("convert", *flags, "--bound", bound, "--force", "-o", path)
                files.append(("coded", bound, path))
            for function in ("CT-Bone", "CT-Bones-Steep"):
                errors = np.zeros(len(files))
                for camera in cameras:
                    def look(*what):
                        run("render", *what, "--size", "512x512", "--camera", camera, "--tf", function, "--background", "black",
                            "--force", "-o", f"{scratch}/p.png")
                        return imagecodecs.imread(f"{scratch}/p.png")[..., :3] / 255.0

                    wanted = look(*flags, "--between-slices", "linear")
                    errors += [np.mean((look(path) - wanted) ** 2) / len(cameras) for *_, path in files]
                for (form, setting, path), error in zip(files, errors):
                    psnr = round(-10 * np.log10(error), 2)
                    table.writerow([name, function, form, setting, os.path.getsize(path), psnr])


def four_sides(affine, corner, scratch):
    """Writes cameras that see the box around a mask from four sides; returns their files."""
    ends = np.array([[affine @ [*(getattr(axis, end) for axis in corner), 1]] for end in ("start", "stop")])[:, 0, :3]
    middle, radius = ends.mean(axis=0), np.linalg.norm(ends[1] - ends[0]) / 2
    files = []
    for number, side in enumerate(([0, 1, 0], [0.7, 0.7, 0.2], [-1, 0.3, 0.3], [0, -1, 0.1])):
        eye = middle + np.array(side) / np.linalg.norm(side) * radius / np.sin(np.radians(15))
        files.append(f"{scratch}/camera.{number}.json")
        with open(files[-1], "w") as file:
            json.dump(dict(eye_mm=list(eye), target_mm=list(middle), up=[0, 0, 1], fov_deg=30), file)
    return files


def show(table):
    """Prints the PSNR of all at the bytes of fits, interpolated over the logarithm of the bytes."""
    with open(table, newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["psnr_db"]]
    others = ["coded", "SZ3", "SZ3, inside", "JPEG-LS", "JPEG XL", "SPERR", "DCT", "zfp"]
    for case in dict.fromkeys(row["case"] for row in rows):
        of_case = [row for row in rows if row["case"] == case]
        voxels = int(of_case[0]["voxels"])

        def at(method, size):
            points = sorted((float(row["bytes"]), float(row["psnr_db"])) for row in of_case if row["method"] == method)
            sizes, psnr = zip(*points) if points else ([np.inf], [0])
            return np.interp(np.log(size), np.log(sizes), psnr, left=np.nan, right=np.nan)

        fits = [row for row in of_case if row["method"] == "splats, .vgs"]
        for row in fits:
            size = float(row["bytes"])
            found = [float(row["psnr_db"]), *(at(method, size) for method in others)]
            texts = ["–" if np.isnan(v) else f"**{v:.1f}**" if v == np.nanmax(found) else f"{v:.1f}" for v in found]
            print("|", " | ".join([f"{case}, {voxels:,}", f"{int(row['setting']):,}", f"{size:,.0f}", f"{size / voxels:.2f}", *texts]), "|")
        sizes = np.geomspace(*(float(row["bytes"]) for row in (fits[0], fits[-1])), 400)
        behind = [size / voxels for size in sizes if at("coded", size) > at("splats, .vgs", size)]
        print(case, "coded is ahead from", round(behind[0], 3) if behind else "nowhere")


def plot(table, out):
    import matplotlib.pyplot as plt

    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "vgs"})
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    cases = list(dict.fromkeys(row["case"] for row in rows))
    figure, axes = plt.subplots(1, len(cases), figsize=(3.6 * len(cases), 3.8), squeeze=False, sharey=True)
    for axis, case in zip(axes[0], cases):
        for method, (colour, line) in LINES.items():
            of_method = [row for row in rows if row["case"] == case and row["method"] == method]
            points = sorted((float(row["bytes_a_voxel"]), float(row["psnr_db"] or "inf")) for row in of_method)
            if method == "lossless":
                axis.axvline(points[0][0], color=colour, linestyle=line, linewidth=0.8, label="lossless (xz)")
            else:
                points = [point for point in points if np.isfinite(point[1])]
                axis.plot(*zip(*points), line, color=colour, markersize=3, label=method)
        axis.set(title=case, xscale="log", xlim=(0.01, 8), ylim=(28, 62), xlabel="bytes a voxel, mask included")
        axis.grid(True, which="both", linewidth=0.3)
    axes[0][0].set_ylabel("PSNR at the voxels, dB")
    axes[0][0].set_yticks(range(30, 61, 5), labels=[str(db) for db in range(30, 61, 5)])
    axes[0][-1].legend(fontsize=7, loc="lower right")
    figure.tight_layout()
    figure.savefig(out, metadata={"Date": None})


def main():
    if sys.argv[1:2] == ["--plot"]:
        return plot(*sys.argv[2:])
    if sys.argv[1:2] == ["--pictures"]:
        return pictures(*sys.argv[2:])
    if sys.argv[1:2] == ["--table"]:
        return show(*sys.argv[2:])
    if sys.argv[1:2] == ["--coded"]:
        return anew(*sys.argv[2:], ["coded"], of_coder)
    if sys.argv[1:2] == ["--splats"]:
        return anew(*sys.argv[2:], ["splats, PLY", "splats, .vgs"], of_splats)
    data, out, *names = sys.argv[1:]
    with open(out, "a", newline="") as file:
        fields = "case voxels method setting bytes bytes_a_voxel psnr_db mask_bytes".split()
        table = csv.DictWriter(file, fields)
        if file.tell() == 0:
            table.writeheader()
        for name in names or CASES:
            measure(name, data, lambda row: (table.writerow(row), file.flush()))


main()
