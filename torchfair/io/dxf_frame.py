"""What stands around the meshes of a DXF file: header, classes, tables, blocks and objects of AutoCAD 2010."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

_NAMES = (
    "None Inches Feet Miles Millimeters Centimeters Meters Kilometers Microinches Mils Yards Angstroms Nanometers "
    "Microns Decimeters Dekameters Hectometers Gigameters AstronomicalUnits LightYears Parsecs"
)
UNITS = {str(number): name for number, name in enumerate(_NAMES.split())}  # $INSUNITS, by their names in Rhino
_FORBIDDEN = str.maketrans(dict.fromkeys('<>/\\":;?*|=`,', "_"))
_MODEL, _PAPER = "*Model_Space", "*Paper_Space"
Pair = tuple[int, object]


def layer_name(path: str) -> str:
    """A layer such as Roof::Glass as it can be called in DXF."""
    return " ".join(path.split()).translate(_FORBIDDEN) or "0"


def framed(meshes: Sequence[tuple[str, str]], unit: str) -> bytes:
    """The bytes of a drawing.

    Args:
        meshes: Layer of each, and what is said of it in its subclass, as text.
        unit: By its name in Rhino; unknown ones are left out.
    """
    handles = (f"{number:X}" for number in itertools.count(0x10))
    model, paper = next(handles), next(handles)
    layers = list(dict.fromkeys(["0", *(layer_name(layer) for layer, _ in meshes)]))
    tables, blocks = _tables(handles, layers, model, paper), _blocks(handles, model, paper)
    entities = [
        _text([(0, "MESH"), (5, next(handles)), (330, model), (100, "AcDbEntity"), (8, layer_name(layer))]) + body
        for layer, body in meshes
    ]
    objects = _objects(handles)
    number = next((number for number, name in UNITS.items() if name == unit), "0")
    header = [(9, "$ACADVER"), (1, "AC1024"), (9, "$DWGCODEPAGE"), (3, "ANSI_1252"), (9, "$INSUNITS"), (70, number),
        (9, "$HANDSEED"), (5, next(handles))]  # fmt: skip
    classes = [(0, "CLASS"), (1, "MESH"), (2, "AcDbSubDMesh"), (3, "SCENEOE"), (90, 0), (91, len(meshes)), (280, 0),
        (281, 1)]  # fmt: skip
    parts = {"HEADER": _text(header), "CLASSES": _text(classes), "TABLES": _text(tables), "BLOCKS": _text(blocks)}
    parts |= {"ENTITIES": "".join(entities), "OBJECTS": _text(objects)}
    whole = "".join(f"0\nSECTION\n2\n{name}\n{body}0\nENDSEC\n" for name, body in parts.items())
    return f"{whole}0\nEOF\n".encode()


def _text(pairs: Iterable[Pair]) -> str:
    return "".join(f"{code}\n{value}\n" for code, value in pairs)


def _tables(handles: Iterable[str], layers: Sequence[str], model: str, paper: str) -> list[Pair]:
    """All nine tables; records that every drawing has."""
    line: list[Pair] = [(72, 65), (73, 0), (40, 0.0)]
    records: dict[str, list[tuple[str, str, list[Pair]]]] = {
        "VPORT": [("AcDbViewportTableRecord", "*Active", [(10, 0.0), (20, 0.0), (11, 1.0), (21, 1.0), (12, 0.0),
            (22, 0.0), (13, 0.0), (23, 0.0), (14, 10.0), (24, 10.0), (15, 10.0), (25, 10.0), (16, 0.0), (26, 0.0),
            (36, 1.0), (17, 0.0), (27, 0.0), (37, 0.0), (40, 10.0), (41, 1.5), (42, 50.0), (43, 0.0), (44, 0.0),
            (50, 0.0), (51, 0.0), (71, 0), (72, 1000), (73, 1), (74, 3), (75, 0), (76, 0), (77, 0), (78, 0)])],
        "LTYPE": [("AcDbLinetypeTableRecord", name, [(3, ""), *line]) for name in ("ByBlock", "ByLayer", "Continuous")],
        "LAYER": [("AcDbLayerTableRecord", name, [(62, 7), (6, "Continuous")]) for name in layers],
        "STYLE": [("AcDbTextStyleTableRecord", "Standard", [(40, 0.0), (41, 1.0), (50, 0.0), (71, 0), (42, 2.5),
            (3, "txt"), (4, "")])],
        "VIEW": [],
        "UCS": [],
        "APPID": [("AcDbRegAppTableRecord", "ACAD", [])],
        "DIMSTYLE": [("AcDbDimStyleTableRecord", "Standard", [])],
        "BLOCK_RECORD": [("AcDbBlockTableRecord", name, []) for name in (_MODEL, _PAPER)],
    }  # fmt: skip
    fixed = {_MODEL: model, _PAPER: paper}
    handles = iter(handles)
    pairs: list[Pair] = []
    for kind, rows in records.items():
        table = next(handles)
        pairs += [(0, "TABLE"), (2, kind), (5, table), (330, 0), (100, "AcDbSymbolTable"), (70, len(rows))]
        if kind == "DIMSTYLE":
            pairs += [(100, "AcDbDimStyleTable"), (71, 0)]
        for subclass, name, more in rows:
            pairs += [(0, kind), (105 if kind == "DIMSTYLE" else 5, fixed.get(name) or next(handles)), (330, table)]
            pairs += [(100, "AcDbSymbolTableRecord"), (100, subclass), (2, name)]
            pairs += [(340, 0)] if kind == "BLOCK_RECORD" else [(70, 0), *more]
        pairs.append((0, "ENDTAB"))
    return pairs


def _blocks(handles: Iterable[str], model: str, paper: str) -> list[Pair]:
    """The two empty blocks that stand for the model and the sheet."""
    handles = iter(handles)
    pairs: list[Pair] = []
    for name, owner in ((_MODEL, model), (_PAPER, paper)):
        sheet: list[Pair] = [(67, 1)] if name == _PAPER else []
        own: list[Pair] = [(330, owner), (100, "AcDbEntity"), *sheet, (8, "0")]
        pairs += [(0, "BLOCK"), (5, next(handles)), *own, (100, "AcDbBlockBegin"), (2, name), (70, 0), (10, 0.0),
            (20, 0.0), (30, 0.0), (3, name), (1, ""), (0, "ENDBLK"), (5, next(handles)), *own,
            (100, "AcDbBlockEnd")]  # fmt: skip
    return pairs


def _objects(handles: Iterable[str]) -> list[Pair]:
    """The dictionary of the drawing, with an empty one of groups."""
    handles = iter(handles)
    root, groups = next(handles), next(handles)
    top: list[Pair] = [(0, "DICTIONARY"), (5, root), (330, 0), (100, "AcDbDictionary"), (281, 1)]
    return [*top, (3, "ACAD_GROUP"), (350, groups), (0, "DICTIONARY"), (5, groups), (330, root),
        (100, "AcDbDictionary"), (281, 1)]  # fmt: skip
