"""OME-Zarr over the product of its options."""

import functools
import json

import numcodecs
import numpy as np
import zarr
from zarr.codecs import BloscCodec, BytesCodec, Crc32cCodec, GzipCodec, ShardingCodec, TransposeCodec, ZstdCodec

from case import Case, Grid, product_of
from flat import KINDS, values_of
from readers import zarr_

BLOSC = ["blosclz", "lz4", "lz4hc", "zlib", "zstd"]
SHUFFLES = {"noshuffle": 0, "shuffle": 1, "bitshuffle": 2}
DIRECTIONS = {
    "left-to-right": [1, 0, 0],
    "right-to-left": [-1, 0, 0],
    "posterior-to-anterior": [0, 1, 0],
    "anterior-to-posterior": [0, -1, 0],
    "inferior-to-superior": [0, 0, 1],
    "superior-to-inferior": [0, 0, -1],
}
SCALE, ORIGIN = [0.5, 0.75, 2.5], [-12.5, 30.25, -100.0]


def cases():
    for version, kind, order in product_of([2, 3], [*KINDS, "f2", "b1"], "<>"):
        yield zarr_case(f"Zarr type: {version}, {kind}, {order}", version, kind, order)
    for version, compressor in product_of([2, 3], ["none", "gzip", "zstd"]):
        yield zarr_case(f"Zarr codec: {version}, {compressor}", version, compressor=compressor)
    for version, compressor, shuffle in product_of([2, 3], BLOSC, SHUFFLES):
        yield zarr_case(f"Zarr codec: {version}, blosc {compressor}, {shuffle}", version, compressor=(compressor, shuffle))
    yield zarr_case("Zarr codec: 2, zlib", 2, compressor="zlib")
    for compressor in ["bz2", "lzma", "lz4"]:
        yield zarr_case(f"Zarr codec: 2, {compressor}", 2, compressor=compressor, odd=compressor)
    for end, inside, around in product_of(["start", "end"], ["none", "gzip", "zstd", "crc32c"], [False, True]):
        name = f"Zarr shards: index at the {end}, {inside} inside{', crc32c around' if around else ''}"
        yield zarr_case(name, shards=(end, inside, around))
    for version, order in product_of([2, 3], "CF"):
        yield zarr_case(f"Zarr order: {version}, {order}", version, order=order)
    for version, chunks in product_of([2, 3], [(1, 1, 1), (3, 4, 5), (2, 3, 2), (7, 7, 7)]):
        yield zarr_case(f"Zarr chunks: {version}, {chunks}", version, chunks=chunks)
    for version, separator in product_of([2, 3], "./"):
        yield zarr_case(f"Zarr separator: {version}, {separator}", version, separator=separator)
    for version, fill in product_of([2, 3], [0, -1000.0, "NaN", "-Infinity"]):
        yield zarr_case(f"Zarr fill value: {version}, {fill}", version, "f4", fill=fill)
    for version, axes in product_of([2, 3], ["zyx", "czyx", "tzyx", "tczyx", "xyz", "yxz", "cxyz"]):
        yield zarr_case(f"Zarr axes: {version}, {axes}", version, axes=axes)
    for axes in ["yx", "cyx", "tc"]:
        yield zarr_case(f"Zarr axes: {axes}", axes=axes, odd="axes")
    for unit, mm in [("nanometer", 1e-6), ("micrometer", 1e-3), ("millimeter", 1), ("centimeter", 10), ("meter", 1e3)]:
        yield zarr_case(f"Zarr unit: {unit}", unit=(unit, mm))
    yield zarr_case("Zarr unit: none", unit=(None, 1), warns="unit")
    for unit in ["parsec", "pixel", ""]:
        yield zarr_case(f"Zarr unit: {unit or 'empty'}", unit=(unit, 1), odd="unit")
    names = list(DIRECTIONS)
    for x, y, z in product_of(names[:2], names[2:4], names[4:]):
        yield zarr_case(f"Zarr directions: {x}, {y}, {z}", directions=[x, y, z])
    yield zarr_case("Zarr directions: turned", directions=[names[5], names[1], names[2]])
    yield zarr_case("Zarr directions: two of them", directions=[names[1], names[3], None], warns="patient")
    yield zarr_case("Zarr directions: up", directions=[names[1], names[3], "up"], odd="orientation")
    for twice, moved in product_of([False, True], [False, True]):
        name = f"Zarr transformations: {'of each and all' if twice else 'of each'}, {'moved' if moved else 'at zero'}"
        yield zarr_case(name, twice=twice, moved=moved)


def codecs_of(version, compressor):
    """Returns a compressor of zarr-python."""
    if isinstance(compressor, tuple):
        name, shuffle = compressor
        if version == 2:
            return numcodecs.Blosc(cname=name, clevel=5, shuffle=SHUFFLES[shuffle])
        return BloscCodec(cname=name, clevel=5, shuffle=shuffle, typesize=2)
    if version == 2:
        return {
            "none": lambda: None,
            "gzip": numcodecs.GZip,
            "zlib": numcodecs.Zlib,
            "zstd": numcodecs.Zstd,
            "bz2": numcodecs.BZ2,
            "lzma": numcodecs.LZMA,
            "lz4": numcodecs.LZ4,
        }[compressor]()
    return {"none": lambda: None, "gzip": GzipCodec, "zstd": ZstdCodec, "crc32c": Crc32cCodec}[compressor]()


def zarr_case(
    name,
    version=3,
    kind="i2",
    byte_order="<",
    compressor="zstd",
    shards=None,
    order="C",
    chunks=(2, 3, 2),
    separator="/",
    fill=0,
    axes="zyx",
    unit=("millimeter", 1),
    directions=None,
    twice=False,
    moved=True,
    odd=None,
    warns=None,
):
    values = values_of(name, "u1" if kind == "b1" else "f4" if kind == "f2" else kind)
    if kind == "b1":
        values = values % 2
    if kind == "f2":
        values = values.astype("f2").astype("f8")
    if fill:
        # A chunk that holds nothing else is not written.
        values[:2, :3, :2] = float(fill)
    # The array has the axes in their order; of times and channels it is the second that is right.
    space = [axis for axis in axes if axis in "xyz"]
    stored = np.moveaxis(values, range(3), [space.index(axis) for axis in "xyz"]) if len(space) == 3 else values[..., 0].T
    for axis in reversed([axis for axis in axes if axis not in "xyz"]):
        stored = np.stack([np.zeros_like(stored), stored])
    stored = stored.astype("?" if kind == "b1" else byte_order + kind)
    others = stored.ndim - len(space)

    def write(folder):
        path = folder / "a.zarr"
        group = zarr.open_group(path, mode="w", zarr_format=version)
        whole = (1,) * others + chunks[:len(space)]
        options = {"shape": stored.shape, "chunks": whole, "fill_value": float(fill) if kind[0] == "f" else fill}
        encoding = {"name": "v2" if version == 2 else "default", "separator": separator}
        if version == 2:
            options |= {"dtype": stored.dtype, "compressors": codecs_of(2, compressor), "order": order}
        elif shards:
            end, inside, around = shards
            inner = [BytesCodec()] + ([codecs_of(3, inside)] if inside != "none" else [])
            shard = ShardingCodec(chunk_shape=(1, 1, 2), codecs=inner, index_location=end)
            options |= {"chunks": (2, 4, 4), "serializer": shard, "compressors": [Crc32cCodec()] if around else None}
            options |= {"dtype": stored.dtype}
        else:
            little = "little" if byte_order == "<" else "big"
            options |= {"dtype": stored.dtype, "compressors": codecs_of(3, compressor)}
            options |= {"serializer": BytesCodec(endian=None if kind[1] == "1" else little)}
            if order == "F":
                options |= {"filters": [TransposeCodec(order=tuple(reversed(range(stored.ndim))))]}
        array = group.create_array("s0", chunk_key_encoding=encoding, config={"write_empty_chunks": False}, **options)
        array[...] = stored
        group.attrs.update(json.loads(json.dumps(attributes())))
        return path

    def attributes():
        rows = []
        for axis in axes:
            row = {"name": axis, "type": {"t": "time", "c": "channel"}.get(axis, "space")}
            if axis in "xyz":
                row |= {} if unit[0] is None else {"unit": unit[0]}
                direction = directions and directions["xyz".index(axis)]
                row |= {"orientation": {"type": "anatomical", "value": direction}} if direction else {}
            rows.append(row)
        of_axes = {"scale": [SCALE["xyz".index(axis)] if axis in "xyz" else 1.0 for axis in axes]}
        moves = {"translation": [ORIGIN["xyz".index(axis)] if axis in "xyz" else 0.0 for axis in axes]}
        steps = [{"type": "scale", **of_axes}] + ([{"type": "translation", **moves}] if moved else [])
        image = {"version": "0.4", "axes": rows, "datasets": [{"path": "s0", "coordinateTransformations": steps}]}
        if twice:
            image["coordinateTransformations"] = [{"type": "scale", "scale": [2.0] * len(axes)}]
        return {"ome": {"version": "0.5", "multiscales": [image]}} if version == 3 else {"multiscales": [image]}

    truth = None
    if not odd:
        oriented = bool(directions) and None not in directions
        frame = np.array([DIRECTIONS[name] for name in directions]).T if oriented else np.eye(3)
        factor = unit[1] * (2 if twice else 1)
        matrix = np.eye(4)
        matrix[:3, :3] = frame * SCALE * factor
        matrix[:3, 3] = frame @ np.array(ORIGIN) * factor * moved
        truth = Grid(np.asarray(values, "f8"), matrix, oriented)
    if not directions:
        warns = warns or "patient"
    options = {"volume_index": 2**others - 1} if others else {}
    return Case(name, write, truth, {"zarr": functools.partial(zarr_, index=2**others - 1)}, odd, None if odd else warns, options)
