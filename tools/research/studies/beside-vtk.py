#!/usr/bin/env python3
"""Makes docs/results/beside-vtk.md: a CT in VTK, the same CT in vgs, and splats of it, from one camera.

usage: beside-vtk.py [--vgs PROGRAM] [--work FOLDER] [--out FOLDER] DATA [CASE...]

DATA has a folder for each scan, with a volume and masks. --vgs is a release build of vgs (target/release/vgs). The page and its
pictures go to --out (docs/results). --work (target/beside-vtk) keeps splats, which are fitted again where they are removed, and
pictures and figures of VTK and of vgs, which another version makes again. With names of cases, the page has
only these.

It needs vtk==9.7.2 numpy==2.4.6 nibabel==5.4.2 pillow==13.0.0, and OpenGL by EGL (libegl1 and libgl1-mesa-dri on a Debian
without a GPU).
"""
import argparse, hashlib, json, re, resource, subprocess, time
from pathlib import Path
from typing import NamedTuple
import nibabel, numpy as np, vtk
from PIL import Image, ImageDraw, ImageFont
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

REPO = Path(__file__).resolve().parents[3]
SIZE = 512
FOV = 30.0
# Half the shortest edge of a voxel: the sample distance of 3D Slicer, whose oversampling factor is 2 by default.
SLICER_SAMPLE = 0.5
# Voxels from sample to sample in a converged picture.
FINEST = 0.05
# Frames of the long and of the short turn: the time of a frame is that of the one less that of the other.
TURNS = 14, 2
# Frames of VTK's turn, which are slow.
VTK_TURN = 6
AIR = -1000


class Shown(NamedTuple):
    """What a case shows, and from where."""

    folder: str
    volume: str
    mask: str
    preset: str
    # Direction to the eye, RAS.
    towards: tuple
    # How near the eye is: at 1 all of the region is seen.
    zoom: float
    # From the middle of the region to that of the picture, in shares of the picture: to the right, up.
    shift: tuple = (0, 0)
    # Whether VTK gets the mask as such, or a CT with air outside of it.
    mask_input: bool = False
    # What is seen in this case alone.
    remark: str = ""


CASES = {
    "torso bones": Shown("ct-torso-3mm", "ct", "mask_bones", "CT-Bone", (0.5, 1, 0.25), 1.5, (0, -0.1), True),
    "abdomen bones": Shown("ct-abdomen-full", "ct", "mask_bones", "CT-Bone", (-0.5, -1, 0.2), 1.5, (0, 0), True,
                           "Slices lie 4.25 mm apart. VTK shows steps along the ribs; vgs puts slices of its own between them, "
                           "which look right and were never measured, and takes half a minute for that before the first picture."),
    "skull": Shown("ct-skull", "ct", "mask_skull", "CT-Bone", (-0.7, 1, 0.1), 1.4, (0, 0), True),
    "vessels": Shown("ct-thorax-1p5mm", "ct", "mask_vessels", "CT-Angio", (-0.4, 1, 0.1), 1.6, (-0.07, 0.08)),
    "heart": Shown("ct-thorax-1p5mm", "ct", "mask_heart", "CT-Muscle", (-0.3, 1, 0.2), 1.1, (0, -0.02)),
    "torso": Shown("ct-torso-3mm", "ct", "mask_ts", "CT-Soft-Tissue", (-0.5, 1, 0.1), 1.3, (0, -0.05),
                   remark="Where all is translucent the programs differ least, and there is little to skip, so vgs gains least "
                          "there. Splats smooth the noise of soft tissue."),
}


PAGE = """\
# Beside VTK

A scan in VTK, the same scan in vgs, and splats of it in vgs, from one camera and through one transfer function. All else is what
each program does by default, because that is what people see.

| | how |
|---|---|
| VTK | {vtk}, `vtkOpenGLGPUVolumeRayCastMapper` as 3D Slicer sets it in quality *Normal*: lit, trilinear, a sample every half of the shortest voxel edge, no jittering; {vtk_device} |
| scan | vgs {version}, `vgs render SCAN --roi MASK --mode volume`; {vgs_device} |
| splats | `vgs fit SCAN --roi MASK -o a.ply`, `vgs render a.ply`; the same driver |

```sh
tools/research/studies/beside-vtk.py DATA          # vtk==9.7.2 numpy==2.4.6 nibabel==5.4.2 pillow==13.0.0
```

On {processor}, without a GPU. *core-s*: processor time of a frame of 512 × 512 pixels in a turn, of all threads; that of vgs
includes the PNG. *Limit*: PSNR of the picture against the same with samples every 0.05 voxels, so how near the default is to what
its own program would show with patience. *To scan*: PSNR of the splats against the scan in vgs. PLY and `.vgs` hold the same
splats.

{table}
- **The light differs**: VTK's is a headlight, that of vgs stands above the left shoulder (`--headlight` gives VTK's). Compare
  structure, not brightness.
- **So does the edge of the region.** Around organs and vessels VTK has air, which is how Slicer masks a volume. Bones it
  gets with the mask (`SetMaskInput`), which looks better there. It gets the box of the region alone, which saves it time.

## What is seen

- **Grain: vgs is better.** VTK's even steps leave dots and rings on what faces the eye, such as the forehead; jittering would
  make noise of them. vgs takes finer steps, but only where something can show.
- **Edges: vgs is better.** Next to air, VTK's heart becomes a flight of stairs, and a rim of intensities between those of contrast
  medium and air tints heart and vessels. vgs smooths the mask, and continues the object's own intensities beyond it.
- **Splats look like the scan in vgs**, and take at most 1.4 times its time.
- **Time: not a verdict on GPUs.** VTK samples every ray all through the box, vgs skips what is empty. On a processor that
  decides; no GPU was measured. The drivers differ in age, too.

## Pictures
{pictures}"""


class Case:
    """A case: its files, its region, its camera and its transfer function, in `work`."""

    def __init__(self, name, data, work):
        self.name, self.shown = name, CASES[name]
        self.volume, self.mask = (data / self.shown.folder / f"{file}.nii.gz" for file in self.shown[1:3])
        self.work = work / name.replace(" ", "-")
        self.work.mkdir(parents=True, exist_ok=True)
        # Axes in the order and the direction of RAS, so that VTK's axes are the patient's.
        image, region = (nibabel.as_closest_canonical(nibabel.load(path)) for path in (self.volume, self.mask))
        self.affine = image.affine
        self.values = np.asarray(image.dataobj, dtype=np.float32)
        self.region = np.asarray(region.dataobj) > 0.5
        self.edges = np.linalg.norm(self.affine[:3, :3], axis=0)
        assert np.allclose(self.affine[:3, :3], np.diag(self.edges), atol=1e-4), "a grid along the patient's axes"
        self.function = transfer_function(self.shown.preset, self.values)
        self.tf, self.camera = self.work / "tf.vp.json", self.work / "camera.json"
        write_json(self.tf, slicer_property(self.shown.preset, self.function))
        self.look = self.find_camera()
        write_json(self.camera, self.look)

    def find_camera(self):
        """Returns the camera as files of vgs have it."""
        towards = np.array(self.shown.towards) / np.linalg.norm(self.shown.towards)
        right = np.cross([0, 0, 1], towards)
        right /= np.linalg.norm(right)
        up = np.cross(towards, right)
        found = np.argwhere(self.region)[:, None, :]
        ends = np.concatenate([found.min(0), found.max(0)])
        corners = np.array([[ends[i >> k & 1, k] for k in range(3)] for i in range(8)]) * self.edges + self.affine[:3, 3]
        target = (corners.min(0) + corners.max(0)) / 2
        away = corners - target
        half = np.tan(np.radians(FOV / 2))
        far = max(np.max(np.abs(away @ axis) / half + away @ towards) for axis in (right, up)) / self.shown.zoom
        target = target + (right * self.shown.shift[0] + up * self.shown.shift[1]) * 2 * half * far
        return dict(eye_mm=list(target + far * towards), target_mm=list(target), up=[0.0, 0.0, 1.0], fov_deg=FOV)


def write_json(path, content):
    path.write_text(json.dumps(content, indent=1))


def transfer_function(preset, values):
    """Returns colours, opacities per mm and material of a preset of vgs, as its source has them."""
    source = (REPO / "engine/transfer/src/presets.rs").read_text()
    row = re.search(rf'name: "{preset}",(.*?)\n    }},', source, re.S).group(1)
    material = re.search(r"material: (\w+)", row).group(1)
    shading = re.search(rf"const {material}: Material = shaded\(([^)]*)\)", source).group(1)
    hu = "Unit::Hu" in row
    low, width = (0.0, 1.0) if hu else (float(values.min()), float(np.ptp(values)))

    def points(name):
        text = re.search(rf"{name}: &\[(.*?)\],\n\s*(?:opacities|material)", row, re.S).group(1)
        number = r"\s*(-?[\d.]+)\s*"
        value = rf"\[{number},{number},{number}\]" if name == "colours" else number
        return [(low + width * float(x), *map(float, rest)) for x, *rest in re.findall(rf"\({number},\s*{value}\)", text)]

    return dict(colours=points("colours"), opacities=points("opacities"),
                material=[float(share) for share in shading.split(",")], background=AIR if hu else 0)


def slicer_property(name, function):
    """Returns a transfer function as Slicer's .vp.json has it, which vgs reads, too."""
    ambient, diffuse, specular, power = function["material"]
    return {"volumeProperties": [{"name": name, "components": [{
        "shade": True,
        "lighting": dict(ambient=ambient, diffuse=diffuse, specular=specular, specularPower=power),
        "rgbTransferFunction": {"points": [dict(x=x, color=rgb) for x, *rgb in function["colours"]]},
        "scalarOpacity": {"points": [dict(x=x, y=y) for x, y in function["opacities"]]},
    }]}]}


class Vtk:
    """A case in VTK, as 3D Slicer shows it at first."""

    def __init__(self, case):
        masked, found = case.shown.mask_input, np.argwhere(case.region)
        low = np.maximum(found.min(0) - 2, 0)
        box = tuple(slice(a, b) for a, b in zip(low, found.max(0) + 3))
        inside = case.region[box]
        values = case.values[box] if masked else np.where(inside, case.values[box], case.function["background"])
        mapper = vtk.vtkOpenGLGPUVolumeRayCastMapper()
        mapper.SetInputData(self.image(case, low, values.astype(np.int16)))
        if masked:
            mapper.SetMaskInput(self.image(case, low, inside.astype(np.uint8) * 255))
            mapper.SetMaskTypeToBinary()
        mapper.SetBlendModeToComposite()
        mapper.SetAutoAdjustSampleDistances(False)
        mapper.SetUseJittering(False)
        self.mapper, self.edge = mapper, float(case.edges.min())
        volume = vtk.vtkVolume()
        volume.SetMapper(mapper)
        volume.SetProperty(self.property(case.function))
        self.renderer = vtk.vtkRenderer()
        self.renderer.SetBackground(0, 0, 0)
        self.renderer.AddVolume(volume)
        camera = self.renderer.GetActiveCamera()
        camera.SetPosition(case.look["eye_mm"])
        camera.SetFocalPoint(case.look["target_mm"])
        camera.SetViewUp(case.look["up"])
        camera.SetViewAngle(FOV)
        self.renderer.ResetCameraClippingRange()
        self.window = vtk.vtkEGLRenderWindow()
        self.window.SetOffScreenRendering(True)
        self.window.SetMultiSamples(0)
        self.window.SetSize(SIZE, SIZE)
        self.window.AddRenderer(self.renderer)

    @staticmethod
    def image(case, low, values):
        image = vtk.vtkImageData()
        image.SetDimensions(values.shape)
        image.SetSpacing(case.edges)
        image.SetOrigin(low * case.edges + case.affine[:3, 3])
        image.GetPointData().SetScalars(numpy_to_vtk(values.ravel(order="F"), deep=True))
        return image

    @staticmethod
    def property(function):
        colours, opacities = vtk.vtkColorTransferFunction(), vtk.vtkPiecewiseFunction()
        for point in function["colours"]:
            colours.AddRGBPoint(*point)
        for point in function["opacities"]:
            opacities.AddPoint(*point)
        found = vtk.vtkVolumeProperty()
        found.SetColor(colours)
        found.SetScalarOpacity(opacities)
        found.SetScalarOpacityUnitDistance(1.0)
        found.SetInterpolationTypeToLinear()
        found.ShadeOn()
        ambient, diffuse, specular, power = function["material"]
        found.SetAmbient(ambient)
        found.SetDiffuse(diffuse)
        found.SetSpecular(specular)
        found.SetSpecularPower(power)
        return found

    def render(self, voxels):
        self.mapper.SetSampleDistance(voxels * self.edge)
        self.window.Render()
        grab = vtk.vtkWindowToImageFilter()
        grab.SetInput(self.window)
        grab.ReadFrontBufferOff()
        grab.Update()
        rows = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).reshape(SIZE, SIZE, -1)
        return Image.fromarray(np.ascontiguousarray(rows[::-1, :, :3]))

    def frame_seconds(self):
        """Returns processor time of a frame: of a turn, after a first frame that uploads and compiles."""
        self.render(SLICER_SAMPLE)
        camera, turn = self.renderer.GetActiveCamera(), VTK_TURN
        before = time.process_time()
        for _ in range(turn):
            camera.Azimuth(360 / turn)
            self.renderer.ResetCameraClippingRange()
            self.window.Render()
            self.window.WaitForCompletion()
        return (time.process_time() - before) / turn

    def device(self):
        told = self.window.ReportCapabilities()
        renderer, version = (re.search(rf"OpenGL {key} string:\s*(.*)", told).group(1) for key in ("renderer", "version"))
        return f"{renderer}, OpenGL {version}"


class Vgs:
    def __init__(self, program):
        self.checksum = hashlib.sha256(program.read_bytes()).hexdigest()
        self.command = [str(REPO / "tools/run"), str(program)]

    def __call__(self, *arguments):
        done = subprocess.run([*self.command, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{' '.join(map(str, arguments))}\n{done.stderr}")
        return done.stdout

    def render(self, case, scene, out, *more):
        return json.loads(self("render", *scene, "--tf", case.tf, "--camera", case.camera, "--size", f"{SIZE}x{SIZE}",
                               "-o", out, "--force", "--json", *more))

    def frame_seconds(self, case, scene):
        """Returns processor time of a frame: the difference of a long and a short turn."""
        out = case.work / "turn.png"

        def used(frames):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            self.render(case, scene, out, "--turntable", frames)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

        long, short = (used(frames) for frames in TURNS)
        out.unlink()
        return (long - short) / (TURNS[0] - TURNS[1])


def psnr(a, b):
    error = np.mean((np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64)) ** 2)
    return 10 * np.log10(255**2 / error) if error else np.inf


def kept(case, name, program, render):
    """Returns the picture of a scene and what was measured of it: from the work folder if this program made it."""
    plain, finest, told = (case.work / f"{name}{end}" for end in (".png", "-finest.png", ".json"))
    made_of = json.loads(json.dumps([program, case.look, case.function, case.shown.mask_input]))
    found = json.loads(told.read_text()) if told.exists() else {}
    if found.get("made_of") != made_of:
        found = dict(made_of=made_of, **render(plain, finest))
        write_json(told, found)
    picture, limit = (Image.open(path).convert("RGB") for path in (plain, finest))
    return picture, dict(found, db=psnr(picture, limit))


def of_vtk(case):
    def render(plain, finest):
        scene = Vtk(case)
        scene.render(SLICER_SAMPLE).save(plain)
        scene.render(FINEST).save(finest)
        return dict(seconds=scene.frame_seconds(), device=scene.device())

    return kept(case, "vtk", vtk.vtkVersion.GetVTKVersion(), render)


def of_vgs(vgs, case, name, scene):
    def render(plain, finest):
        told = vgs.render(case, scene, plain)
        vgs.render(case, scene, finest, "--step", FINEST, "--cell", FINEST)
        return dict(seconds=vgs.frame_seconds(case, scene), device=told["driver"], splats=told["splats"])

    return kept(case, name, vgs.checksum, render)


def splats_of(vgs, case):
    """Returns the splats of a case as PLY and as .vgs, from the work folder if they are there."""
    ply, small, record = (case.work / f"splats{end}" for end in (".ply", ".vgs", ".run.json"))
    # A fit that was stopped leaves splats, too.
    if not (ply.exists() and record.exists() and json.loads(record.read_text())["end"] == "finished"):
        vgs("fit", case.volume, "--roi", case.mask, "-o", ply, "--no-eval", "-q", "--force")
        small.unlink(missing_ok=True)
    if not small.exists():
        vgs("convert", ply, "-o", small, "-q")
    return ply, small


def measure(vgs, case):
    """Returns the three pictures of a case, and of each what was measured."""
    ply, small = splats_of(vgs, case)
    columns = [
        of_vtk(case),
        of_vgs(vgs, case, "ct", [case.volume, "--roi", case.mask, "--mode", "volume"]),
        of_vgs(vgs, case, "splats", [ply]),
    ]
    columns[2][1].update(ply=ply.stat().st_size, small=small.stat().st_size, to_ct=psnr(columns[2][0], columns[1][0]))
    return columns


def size(count):
    return f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{count / 1e3:.0f} kB"


def decibels(db):
    return f"{db:.1f}" if np.isfinite(db) else "∞"


def sheet(columns, out):
    """Draws the pictures of a case side by side, with what each costs below."""
    font = ImageFont.load_default(21)
    drawn = Image.new("RGB", (3 * SIZE, SIZE + 66), "white")
    draw = ImageDraw.Draw(drawn)
    splats = columns[2][1]
    names = [f"VTK {vtk.vtkVersion.GetVTKVersion()}", "vgs, the scan itself",
             f"vgs, {splats['splats']:,} splats, {size(splats['ply'])} ({size(splats['small'])})"]
    for i, (name, (picture, found)) in enumerate(zip(names, columns)):
        drawn.paste(picture, (i * SIZE, 0))
        cost = f"{found['seconds']:.2f} core-s a frame, {decibels(found['db'])} dB to its limit"
        for line, text in enumerate((name, cost)):
            draw.text((i * SIZE + SIZE / 2, SIZE + 19 + 28 * line), text, "black", font, anchor="mm")
    drawn.save(out, quality=90, subsampling=0, optimize=True)


HEADER = """\
| case | voxels | VTK | scan | splats | VTK | scan | splats | splats to scan | splats | PLY | `.vgs` |
|---|---|---|---|---|---|---|---|---|---|---|---|
| | | core-s | core-s | core-s | dB | dB | dB | dB | | | |
"""


def row(case, columns):
    found = [told for _, told in columns]
    cells = [case.name, f"{case.region.sum():,}", *(f"{told['seconds']:.2f}" for told in found)]
    cells += [*(decibels(told["db"]) for told in found), decibels(found[2]["to_ct"]), f"{found[2]['splats']:,}"]
    cells += [size(found[2]["ply"]), size(found[2]["small"])]
    return f"| {' | '.join(cells)} |\n"


def processor():
    names = re.findall(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    return f"{len(names)} cores of {names[0]}"


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("data", type=Path, metavar="DATA")
    arguments.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    arguments.add_argument("--vgs", type=Path, metavar="PROGRAM", default=REPO / "target/release/vgs")
    arguments.add_argument("--work", type=Path, metavar="FOLDER", default=REPO / "target/beside-vtk")
    arguments.add_argument("--out", type=Path, metavar="FOLDER", default=REPO / "docs/results")
    asked = arguments.parse_args()
    vgs = Vgs(asked.vgs.absolute())
    rows, pictures, devices = "", "", {}
    for name in asked.cases or CASES:
        begun = time.monotonic()
        case = Case(name, asked.data, asked.work)
        columns = measure(vgs, case)
        picture = f"beside-vtk-{case.work.name}.jpg"
        sheet(columns, asked.out / picture)
        rows += row(case, columns)
        pictures += f"\n**{name.capitalize()}**, {case.shown.preset}. {case.shown.remark}".rstrip()
        pictures += f"\n\n![{name}: VTK, vgs, splats]({picture})\n"
        devices = dict(vtk=columns[0][1]["device"], vgs=columns[1][1]["device"])
        print(f"{rows.splitlines()[-1]}  {time.monotonic() - begun:.0f} s", flush=True)
    version = vgs("--version").split()[1]
    (asked.out / "beside-vtk.md").write_text(PAGE.format(
        table=HEADER + rows, pictures=pictures, processor=processor(), version=version,
        vtk=vtk.vtkVersion.GetVTKVersion(), **{f"{key}_device": value for key, value in devices.items()}))


if __name__ == "__main__":
    main()
