"""Records of numbers that Python and compiled functions share, each declared once as a class.

    class Timing(Record):
        phase: float  # 0 at touchdown
        steps: int = whole()
        velocity: FloatArray = array(2)  # m/s

`Timing()` is such a record with all numbers zero, and `Timing(phase=0.5)` one with a given number.
Python reads and writes its fields. A compiled function takes `timing.records`, an array of shape
(1,) whose element has the same fields, so that the annotations above are valid in both places:

    @compiled
    def advance(timings: Records[Timing], period: float) -> None:
        timing = timings[0]
        timing.phase += period
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
RecordArray = npt.NDArray[np.void]
"""Record of a message, such as `Sensors.record`, as compiled functions take it. Shape (1,)."""

RecordT = TypeVar("RecordT", bound="Record")
Records = Sequence[RecordT]
"""Records as a compiled function takes them: a structured numpy array of shape (n,)."""


_Value = float | Sequence[float] | FloatArray


class _Field:
    """Numpy type and shape of a field, as a class attribute."""

    def __init__(self, kind: Any, shape: tuple[int, ...]) -> None:
        self.kind, self.shape = kind, shape


def array(*shape: int) -> Any:
    """A field of floats of this shape."""
    return _Field(np.float64, shape)


def whole(*shape: int) -> Any:
    """A field of an integer, or of an array of integers of this shape."""
    return _Field(np.int64, shape)


def part(record: type[Record], *shape: int) -> Any:
    """A field of a record of another class, or of an array of such records."""
    return _Field(record.TYPE, shape)


class Record:
    """One record of numbers, see the module. Fields without a value in the class are floats.

    Attributes:
        TYPE: Numpy type of the record.
        records: The record for compiled functions. Shape (1,).
    """

    TYPE: ClassVar[np.dtype[Any]]

    # The element is of this class, which numpy's own types cannot express.
    records: Any

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        fields = {
            name: cls.__dict__.get(name, _Field(np.float64, ()))
            for name in inspect.get_annotations(cls)
        }
        cls.TYPE = np.dtype([(name, field.kind, field.shape) for name, field in fields.items()])
        assert cls.TYPE.fields is not None
        for name, field in fields.items():
            if field.shape or field.kind not in (np.float64, np.int64):
                setattr(cls, name, _Part(name))
            else:
                whole = field.kind is np.int64
                setattr(cls, name, _Number(cls.TYPE.fields[name][1] // 8, whole=whole))

    def __init__(self, *values: _Value, **figures: _Value) -> None:
        self.records = np.zeros(1, self.TYPE)
        words = self.records.view(np.uint8).data
        self._floats, self._integers = words.cast("d"), words.cast("q")
        named = self.records.view(np.recarray)  # gives access to fields of nested records by name
        self._parts = {name: named[name][0] for name in self.TYPE.names or ()}
        given = dict(zip(self._parts, values, strict=False)) | figures
        for name, value in given.items():
            if name not in self._parts:
                raise TypeError(f"{type(self).__name__} has no field {name}")
            setattr(self, name, value)

    def take(self, source: object, *names: str) -> None:
        """Set numbers to the attributes of another object.

        Args:
            source: Object with attributes of these names.
            *names: Fields to set; without any, all that are attributes of `source`.
        """
        for name in names or [name for name in self._parts if hasattr(source, name)]:
            setattr(self, name, getattr(source, name))

    def clear(self) -> None:
        """Set every number to zero."""
        self.records[:] = np.zeros(1, self.TYPE)

    def __repr__(self) -> str:
        return f"{type(self).__name__}{self.records[0]}"


class _Number:
    """Access to a scalar by a word of the record's memory, five times as fast as numpy's access."""

    def __init__(self, place: int, *, whole: bool) -> None:
        self._place, self._whole = place, whole

    def __get__(self, record: Record | None, _: type[Record]) -> Any:
        if record is None:
            return self
        return (record._integers if self._whole else record._floats)[self._place]

    def __set__(self, record: Record, value: float) -> None:
        (record._integers if self._whole else record._floats)[self._place] = value


class _Part:
    """Access to an array or a nested record by a view of the record's memory."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, record: Record | None, _: type[Record]) -> Any:
        return self if record is None else record._parts[self._name]

    def __set__(self, record: Record, value: Any) -> None:
        record._parts[self._name][...] = value
