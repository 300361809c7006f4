"""What is known: where vgs is wrong, where others read otherwise than is right, and what none of them confirms."""

# Cases and real files that vgs reads wrongly, or refuses although nothing is odd, by name, with the reason. The test fails
# as soon as one is mended or another one appears: an entry goes when its reader is mended.
KNOWN_WRONG = {
    "file: bytes after the end, explicit": "refused as damaged, although all elements are there",
}

# Where a program reads otherwise than is right: program, cases (a regular expression), what it does. "|" joins programs.
DISSENT = [
    ("pydicom|SimpleITK", r"bits: .12 in 16, high bit 15", "takes the lower bits, whatever High Bit says"),
    ("SimpleITK", r"bits: .20 in 32", "takes all 32 bits as the value"),
    ("SimpleITK", r"padding: ", "keeps padding as values; vgs has NaN there (PS3.3 C.7.5.1.1.2)"),
    ("pydicom", r"rescale: (slope|intercept) alone", "applies slope and intercept only together"),
    ("SimpleITK", r"rescale: .*(in one slice|for each slice)", "rounds to the type of the first slice's values"),
    ("SimpleITK", r"rescale: decimal comma in the slope", "takes 0,5 as 0"),
    ("SimpleITK", r"modality LUT: ", "ignores the Modality LUT Sequence"),
    ("SimpleITK", r"photometric: MONOCHROME1", "inverts values of MONOCHROME1"),
    (
        "SimpleITK",
        r"distances: .*(missing|twice|far off)|frames: gap",
        "closes gaps between slices; vgs has planes of NaN",
    ),
    ("SimpleITK", r"distances: one slice", "has 1 mm for the thickness of a single slice"),
    ("SimpleITK", r"distances: gantry", "does not shear the grid by the tilt"),
    ("SimpleITK", r"copies: ", "keeps a slice that is there twice"),
    ("SimpleITK", r"frames: .*(mixed|its own)", "keeps the order of the frames in the file, and one slope for all"),
    ("SimpleITK", r"frames: whole concatenation", "reads one file of it"),
    ("pydicom|SimpleITK", r"file: no .* in one slice", "takes the slice as it is, or closes the gap"),
    ("SimpleITK", r"NIfTI scaling: slope (0|nan|inf), ", "adds the intercept without a slope"),
    ("SimpleITK", r"NIfTI scaling: .*intercept (nan|inf)", "leaves the intercept out"),
    ("SimpleITK", r"NIfTI orientation: .*at odds", "takes the qform where both are set"),
    ("SimpleITK", r"NIfTI units: code 1, by qform", "rounds the qform in metres"),
    ("SimpleITK", r"NIfTI axes: x, y", "has no place on the third axis"),
    ("nibabel|SimpleITK", r"NIfTI offset: 0", "reads the header as voxels"),
    ("SimpleITK", r"NIfTI pixdim: -1", "turns the axis round"),
    ("pynrrd|SimpleITK", r"NRRD field: space units: .(u?m). ", "ignores the unit"),
    ("SimpleITK", r"MetaImage type: big endian, text", "swaps the bytes of numbers in text"),
    ("SimpleITK", r"MetaImage field: DistanceUnits = u?m$", "ignores the unit"),
    ("SimpleITK", r"MetaImage header size: .*zlib", "unpacks from the beginning of the file"),
]

# Where no program reads the file rightly: cases, why the truth holds.
ALONE = [
    (r"bits: .12 in 16, high bit 15", "PS3.5 8.1.1: High Bit tells where a value ends"),
    (r"rescale: decimal comma in the slope", "what was meant; it may be refused"),
    (r"modality LUT: 12 bits", "PS3.3 C.11.1: entries of 12 bits in words of 16"),
    (r"file: no preamble, ", "PS3.10 7.1 with 128 bytes missing; it may be refused"),
    (r"file: no .* in one slice", "the slice has no place: it is left out, with a word"),
    (r"file: no BitsAllocated", "what was meant; it may be refused"),
    (r"segmentation: .* Big Endian", "highdicom reads little endian alone"),
    (r"NIfTI file: .*(packed.nii|plain.nii.gz)", "the content counts, whatever the name says"),
    (r"NIfTI scaling: .*intercept (nan|inf)", "no intercept, so no scaling, with a word; or refused"),
    (r"NIfTI offset: 0", "voxels begin after the header; with a word"),
    (r"NRRD field: space units: .(u?m). ", "what the header says; it may be refused"),
    (r"NRRD skip: 0 lines, -1 bytes, ascii", "what was meant; it may be refused"),
    (r"MetaImage type: big endian, text", "text has no order of bytes"),
    (r"MetaImage field: DistanceUnits = u?m$", "what the header says; with a word"),
    (r"copies: other pixels", "of two that differ one is taken, with a word; or refused"),
    (r"MetaImage file: (100%|50 %)", "a name is a pattern only with numbers after it"),
    (r"MetaImage header size: .*zlib", "the header ends where it says"),
    (r"MetaImage header: (lower case keys|NDims later)", "what was meant"),
]
