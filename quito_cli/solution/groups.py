"""Groups of a result file being written: datasets with named axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import h5py


class Group:
    """A group being written: datasets with named axes."""

    def __init__(self, parent: h5py.Group, name: str) -> None:
        self.group = parent.create_group(name)

    def axis(self, name: str, values: Any) -> None:
        """Write a dimension scale."""
        scale = self.dataset(name, values)
        scale.make_scale(name)

    def data(self, name: str, values: Any, *axes: str) -> None:
        """Write an array along axes written before."""
        dataset = self.dataset(name, values)
        for i, axis in enumerate(axes):
            dataset.dims[i].attach_scale(self.group[axis])

    def dataset(self, name: str, values: Any) -> Any:
        """Write numbers or a list of texts."""
        import h5py

        array = np.asarray(values)
        if array.dtype.kind == "U" or (array.size == 0 and array.dtype == object):
            return self.group.create_dataset(
                name, data=array.astype(object), dtype=h5py.string_dtype()
            )
        return self.group.create_dataset(name, data=array)


def texts(values: Any) -> NDArray[np.object_]:
    """Return texts as an array that is written as such, also when it is empty."""
    return np.array(list(values), dtype=object)
