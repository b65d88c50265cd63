"""Files of other tools, each read by its library: vectors with their units, or a table as text.

A text is read like any other table. The libraries are imported where they are needed, in a limited
process: which of them are installed is up to the user.
"""

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from itertools import islice
from typing import Any, BinaryIO, NamedTuple
from zipfile import BadZipFile, ZipFile

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.record.limited_process import limited, result_of

Vectors = Iterator[tuple[str, str, Any]]
"""Name, unit, or an empty one, and values of each vector."""

_HDF5 = b"\x89HDF\r\n\x1a\n"
"""First bytes of what a MAT file of version 7.3 has in it."""
_MOST_LEVELS, _MOST_COLUMNS = 10, 1000
"""Structures in structures, and columns of a matrix, or fields of a message, that are read."""

_TIME = 60
"""Seconds that reading a file may take."""
_TEXT = b"text:"
"""What comes before a table as text in what the process writes."""


class Adapter(NamedTuple):
    """How a format is read."""

    format: str
    """Its name, with an article."""
    package: str
    """What has to be installed to read it, as pip names it."""
    read: Callable[[bytes], Vectors | str]


def _of_mat(content: bytes) -> Vectors:
    return _of_hdf5(content) if _HDF5 in content[:1024] else _of_scipy(content)


def _of_scipy(content: bytes) -> Vectors:
    from scipy.io import loadmat

    variables: Any = loadmat(BytesIO(content), squeeze_me=True)
    for name, values in variables.items():
        if name[:2] != "__":
            yield from _vectors(name, values)


def _of_hdf5(content: bytes) -> Vectors:
    import h5py

    def of_group(prefix: str, group: Any) -> Vectors:
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                sys.exit(f"{prefix}{name} is a link: it may point to another file")
            member = group[name]
            if isinstance(member, h5py.Dataset) and (member.external or member.is_virtual):
                sys.exit(f"{prefix}{name} is stored in another file")
            if isinstance(member, h5py.Group):
                yield from of_group(f"{prefix}{name}.", member)
            elif member.dtype.kind in "biuf":
                unit = member.attrs.get("units", member.attrs.get("unit", ""))
                unit = unit.decode() if isinstance(unit, bytes) else str(unit)
                values = member[()].T if by_columns else member[()]
                for key, _, vector in _vectors(prefix + name, np.squeeze(values)):
                    yield key, unit, vector

    by_columns = content.startswith(b"MATLAB")  # which keeps matrices so
    with h5py.File(BytesIO(content)) as file:
        yield from of_group("", file)


def _vectors(name: str, values: Any, depth: int = 0) -> Vectors:
    """Yield the vectors of a variable: itself, columns of a matrix, fields of a structure."""
    values = np.atleast_1d(values)
    if values.dtype.names and values.size == 1 and depth < _MOST_LEVELS:
        for field in values.dtype.names:
            yield from _vectors(f"{name}.{field}", values[field].item(), depth + 1)
    elif values.dtype.kind in "biuf" and values.ndim == 1:
        yield name, "", values
    elif values.dtype.kind in "biuf" and values.ndim == 2 and values.shape[1] <= _MOST_COLUMNS:
        for number, column in enumerate(values.T, start=1):
            yield f"{name}[{number}]", "", column


def _of_archive(content: bytes) -> Vectors | str:
    """Read what Excel and numpy write, which both are archives."""
    try:
        names = ZipFile(BytesIO(content)).namelist()
    except BadZipFile:
        sys.exit("it is damaged: the archive has no directory")
    if "xl/workbook.xml" in names:
        return _of_excel(content)
    if not any(name.endswith(".npy") for name in names):
        sys.exit("it is an archive, and neither of Excel (.xlsx) nor of numpy (.npz)")
    return _of_numpy(content)


def _of_numpy(content: bytes) -> Vectors:
    """Read an array, which is `data`, or an archive of arrays."""
    loaded: Any = np.load(BytesIO(content), allow_pickle=False)
    arrays = {"data": loaded} if isinstance(loaded, np.ndarray) else loaded
    for name in arrays:
        yield from _vectors(name, np.squeeze(arrays[name]))


def _of_excel(content: bytes) -> str:
    import pandas as pd

    sheets: Any = pd.read_excel(BytesIO(content), sheet_name=None, header=None, engine="openpyxl")
    sizes: dict[str, int] = {name: sheet.size for name, sheet in sheets.items()}
    name = max(sizes, key=sizes.__getitem__)
    if sum(size > 0 for size in sizes.values()) > 1:
        print(f"of {len(sheets)} sheets, {name} is read, the largest", file=sys.stderr)
    return sheets[name].to_csv(header=False, index=False)


def _of_parquet(content: bytes) -> str:
    import pandas as pd

    table: Any = pd.read_parquet(BytesIO(content), engine="pyarrow")
    for name in table.select_dtypes("timedelta"):
        table[name] = table[name].dt.total_seconds()
    has_index = not isinstance(table.index, pd.RangeIndex)
    return table.to_csv(index=has_index)


def _of_tdms(content: bytes) -> Vectors:
    from nptdms import TdmsFile

    groups: Any = TdmsFile.read(BytesIO(content)).groups()
    for group in groups:
        prefix = f"{group.name}." if len(groups) > 1 else ""
        for channel in group.channels():
            values, properties = channel[:], channel.properties
            if values.dtype.kind == "M":
                values = (values - values[:1]) / np.timedelta64(1, "s")
            if values.dtype.kind not in "biuf":
                continue
            if "wf_increment" in properties:  # a waveform has no channel of its times
                offset = properties.get("wf_start_offset", 0.0)
                instants = offset + properties["wf_increment"] * np.arange(len(values))
                yield f"{prefix}{channel.name}.time", "s", instants
            yield prefix + channel.name, str(properties.get("unit_string", "")), values


def _of_yaml(content: bytes) -> str:
    """Read messages as `ros2 topic echo` prints them, one a document."""
    import pandas as pd
    import yaml

    messages: Any = yaml.load_all(content, yaml.CSafeLoader)
    rows = [
        dict(islice(_fields("", message), _MOST_COLUMNS + 1))
        for message in messages
        if isinstance(message, Mapping)
    ]
    if any(len(row) > _MOST_COLUMNS for row in rows):
        sys.exit(f"it has a message of more than {_MOST_COLUMNS} fields")
    if not rows:
        sys.exit("it is YAML, and has no messages as `ros2 topic echo` prints them")
    return pd.DataFrame(rows).to_csv(index=False)


def _of_json(content: bytes) -> str:
    """Read the longest list of rows, or the vectors, that are anywhere in objects of objects."""
    import pandas as pd

    tables: dict[str, Any] = {}

    def search(name: str, value: Any) -> None:
        if isinstance(value, list) and value and isinstance(value[0], list | dict):
            tables[name] = pd.DataFrame(value)
        elif isinstance(value, dict):
            parts: dict[str, Any] = value
            vectors = {key: item for key, item in parts.items() if item and isinstance(item, list)}
            numbers = {key: item for key, item in vectors.items() if type(item[0]) in (int, float)}
            if len({*map(len, numbers.values())}) == 1:
                tables[name] = pd.DataFrame(numbers)
            for key, item in parts.items():
                search(f"{name}.{key}".strip("."), item)

    try:
        search("", json.loads(content))
    except json.JSONDecodeError:
        search("", [json.loads(line) for line in content.splitlines() if line.strip()])
    if not tables:
        sys.exit("it is JSON, and has neither a list of rows nor vectors")
    name = max(tables, key=lambda item: len(tables[item]))
    if len(tables) > 1:
        print(f"{name} is read, the longest of {', '.join(tables)}", file=sys.stderr)
    named = any(isinstance(item, str) for item in tables[name].columns)
    return tables[name].to_csv(index=False, header=named)


def _fields(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a message by their paths; elements of joints by the names of these."""
    if isinstance(value, Mapping):
        if {*value} == {"sec", "nanosec"}:
            yield name, f"{value['sec']}.{value['nanosec']:09d}"
            return
        joints = value.get("name", value.get("joint_names"))
        for key, member in value.items():
            path = f"{name}.{key}" if name else str(key)
            if isinstance(joints, list) and isinstance(member, list) and member is not joints:
                keys = joints if len(member) == len(joints) else range(len(member))
                for joint, element in zip(keys, member, strict=True):
                    yield f"{path}.{joint}", element
            else:
                yield from _fields(path, member)
    elif isinstance(value, list):
        for number, member in enumerate(value):
            yield from _fields(f"{name}[{number}]", member)
    else:
        yield name, value


_MAT = Adapter("an HDF5 file, as MAT of version 7.3,", "h5py", _of_mat)
_YAML = Adapter("YAML", "PyYAML", _of_yaml)
_JSON = Adapter("JSON", "pandas", _of_json)
_BY_START = {
    "MATLAB": _MAT,
    "PK\x03\x04": Adapter("an Excel workbook", "openpyxl", _of_archive),
    "PAR1": Adapter("a Parquet file", "pyarrow", _of_parquet),
    "TDSm": Adapter("a TDMS file", "npTDMS", _of_tdms),
}
_ADAPTERS = {
    **_BY_START,
    **dict.fromkeys((".mat", ".h5", ".hdf5"), _MAT),
    **dict.fromkeys((".yaml", ".yml"), _YAML),
    **dict.fromkeys((".json", ".jsonl", ".ndjson"), _JSON),
    ".npy": Adapter("a numpy array", "numpy", _of_numpy),
}
"""Adapters by the first bytes of a file, and by the end of its name."""


def format_of(start: bytes, suffix: str) -> str | None:
    """Return how a format is known, by the first bytes of a file or the end of its name."""
    sign = next((sign for sign in _BY_START if start.startswith(sign.encode())), suffix)
    return sign if sign in _ADAPTERS else None


def read_foreign(
    stream: BinaryIO, form: str, most: int
) -> tuple[bytes | dict[str, tuple[str, FloatArray]], list[str]]:
    """Return what is in a file of a format as `format_of` names it, and sentences on how.

    It is a table as text, or vectors by name, each behind its unit, which may be empty. Of a
    structure `log` the vector `log.t` is a field, and `data[2]` is the second column of a matrix.
    Raises ValueError if the file cannot be read, or if its vectors have more than `most` numbers.
    """
    output, notes = result_of(__name__, form, str(most), seconds=_TIME, stream=stream)
    if output.startswith(_TEXT):
        return output[len(_TEXT) :], notes
    with np.load(BytesIO(output), allow_pickle=False) as arrays:
        parts = {name.partition("="): arrays[name] for name in arrays}
    return {name: (unit, vector) for (unit, _, name), vector in parts.items()}, notes


def _main(form: str, most: int) -> None:
    """Write what is in the file at standard input to standard output, as text or as numpy does."""
    adapter = _ADAPTERS[form]
    with limited(f"{adapter.format} is read by {adapter.package}: install it"):
        table = adapter.read(sys.stdin.buffer.read())
        if isinstance(table, str):
            sys.stdout.buffer.write(_TEXT + table.encode())
            return
        # With a sign in its name, for numpy takes some names itself.
        vectors = {f"{unit.replace('=', ' ')}={name}": values for name, unit, values in table}
        if sum(map(len, vectors.values())) > most:
            sys.exit(f"it has more than {most} numbers")
        target = BytesIO()
        np.savez(target, **{name: values.astype(float) for name, values in vectors.items()})
        sys.stdout.buffer.write(target.getbuffer())


if __name__ == "__main__":
    _main(sys.argv[1], int(sys.argv[2]))
