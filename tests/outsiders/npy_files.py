"""NPY over the product of its options."""

import numpy as np

from case import Case, Grid, product_of
from flat import KINDS, values_of
from readers import numpy_


def cases():
    for kind, order, fortran in product_of([*KINDS, "f2", "b1"], "<>", [False, True]):
        name = f"NPY type: {kind}, {'little' if order == '<' else 'big'} endian, {'Fortran' if fortran else 'C'} order"
        yield npy_case(name, kind, order, fortran)
    for version, fortran in product_of([1, 2, 3], [False, True]):
        yield npy_case(
            f"NPY version: {version}, {'Fortran' if fortran else 'C'} order", version=version, fortran=fortran
        )
    for kind in ["c8", "c16", "U3", "S2", "M8[s]", "O", "V4", "f16"]:
        yield npy_case(f"NPY type: {kind}", "i2", dtype=kind, odd="(?i)type|dtype|descr")
    for shape in [
        (3, 4),
        (5,),
        (),
        (1, 3, 4, 5),
        (2, 3, 4, 5),
        (1, 1, 3, 4, 5),
        (0, 3, 4),
        (3, 4, 5, 1),
        (3, 4, 5, 3),
        (1, 1, 1),
    ]:
        case = npy_case(f"NPY shape: {shape}", shape=shape)
        if len(shape) != 3 or 0 in shape:
            case.odd = "(?i)shape|axes|volume|dimension"
            case.truth = Grid(case.truth.values[..., 0], np.eye(4), False) if shape == (1, 3, 4, 5) else None
        yield case


def npy_case(name, kind="i2", order="<", fortran=False, version=1, shape=(3, 4, 5), dtype=None, odd=None):
    values = values_of(name, "u1" if kind == "b1" else "f4" if kind == "f2" else kind, shape)
    if kind == "b1":
        values = values % 2
    if kind == "f2":
        values = values.astype("f2")

    def write(folder):
        if dtype:
            array = np.zeros(shape, dtype)
        else:
            array = values.astype(order + kind if kind[1] != "1" else kind)
        array = np.asfortranarray(array) if fortran else array
        with open(folder / "a.npy", "wb") as file:
            np.lib.format.write_array(file, array, (version, 0), allow_pickle=dtype == "O")
        return folder / "a.npy"

    truth = None if dtype else Grid(np.asarray(values, "f8").T, np.eye(4), False)
    return Case(name, write, truth, {"numpy": numpy_}, odd)
