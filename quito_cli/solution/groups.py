"""Groups of a result file being written: datasets with named axes, and attributes.

A result has some eighty small datasets. What h5py's own `create_dataset` looks up for each of them
costs more than the writing, so these go through its low-level interface, with the same bytes.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import h5py


class Attributes:
    """Attributes of a group or a dataset that has none of these names yet."""

    def __init__(self, owner: Any) -> None:
        self._owner = owner

    def __setitem__(self, name: str, value: Any) -> None:
        """Write a number, a truth value or a text."""
        from h5py import h5a

        array = _plain(value)
        made = h5a.create(self._owner, name.encode(), _type(array.dtype), _space(array.shape))
        made.write(array)


class Group:
    """A group being written: datasets with named axes."""

    def __init__(self, parent: h5py.Group, name: str) -> None:
        self._begin(parent.create_group(name))

    def _begin(self, group: h5py.Group) -> None:
        self.group = group
        self.attributes = Attributes(group.id)
        self._scales: dict[str, Any] = {}

    def axis(self, name: str, values: Any) -> None:
        """Write a dimension scale."""
        from h5py import h5ds

        self._scales[name] = scale = self._written(name, values)
        h5ds.set_scale(scale, name.encode())

    def data(self, name: str, values: Any, *axes: str) -> Attributes:
        """Write an array along axes written before; return its attributes, to be written."""
        from h5py import h5ds

        dataset = self._written(name, values)
        for i, axis in enumerate(axes):
            h5ds.attach_scale(dataset, self._scales[axis], i)
        return Attributes(dataset)

    def dataset(self, name: str, values: Any) -> None:
        """Write numbers, a text or a list of texts."""
        self._written(name, values)

    def _written(self, name: str, values: Any) -> Any:
        """Write a dataset and return its low-level handle."""
        from h5py import h5d, h5s

        array = _plain(values)
        kind, space = _type(array.dtype), _space(array.shape)
        made = h5d.create(self.group.id, name.encode(), kind, space, _without_times())
        if array.size:
            made.write(h5s.ALL, h5s.ALL, array)
        return made


def texts(values: Any) -> NDArray[np.object_]:
    """Return texts as an array that is written as such, also when it is empty."""
    return np.array(list(values), dtype=object)


def _plain(values: Any) -> NDArray[Any]:
    """Return numbers or texts as an array in the order of the file; texts as HDF5 has them."""
    array = np.asarray(values, order="C")
    return array.astype(_text()) if array.dtype.kind in "UO" else array


@cache
def _text() -> Any:
    """Return the dtype of texts of any length, in UTF-8."""
    import h5py

    return h5py.string_dtype()


@cache
def _type(dtype: Any) -> Any:
    """Return the type that the file has for a dtype."""
    from h5py import h5t

    return h5t.py_create(dtype, logical=True)


def _space(shape: tuple[int, ...]) -> Any:
    from h5py import h5s

    return h5s.create_simple(shape) if shape else h5s.create(h5s.SCALAR)


@cache
def _without_times() -> Any:
    """Return what datasets are made with: times of their making would change the bytes."""
    from h5py import h5p

    made = h5p.create(h5p.DATASET_CREATE)
    made.set_obj_track_times(False)
    return made
