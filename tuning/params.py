"""Names, units, ranges and relations of userparams.h, read from include/drive/param_table.h: one place for the build and the tuner."""

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tools.common import paths
from tools.common.errors import UserError
from tools.common.param_rows import TABLE, parameters

from .constants import Formulas, nearest



@dataclass(frozen=True)
class Relation:
    """What must hold between parameters: a C condition, and what to change when it does not."""

    condition: str
    message: str


@functools.cache
def _text() -> str:
    return TABLE.read_text(encoding="utf-8").replace("\\\n", " ")


@functools.cache
def relations() -> list[Relation]:
    """Every relation, those of the d currents once for each entry."""
    rows = re.search(r"#define PARAM_RELATION_TABLE\(X\)(.*)", _text())
    entry = re.search(r'#define PARAM_RELATION_IDREF\(X, i\)\s*X\((.*), "([^"]*)" #i "([^"]*)"\)', _text())
    if rows is None or entry is None:
        raise UserError("the table of relations cannot be read", str(paths.shown(TABLE)), "keep PARAM_RELATION_TABLE and PARAM_RELATION_IDREF")
    found = []
    for condition, message, number in re.findall(r'X\(((?:[^"])*?), "([^"]*)"\)|PARAM_RELATION_IDREF\(X, (\d+)\)', rows[1]):
        found.append(Relation(entry[1].replace("##i", number), f"{entry[2]}{number}{entry[3]}") if number else Relation(condition, message))
    return found


def _python(condition: str) -> str:
    """The C condition as a Python expression in single precision."""
    text = re.sub(r"(?<![\w.])(\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)F?\b", r"number(\1)", condition)
    return text.replace("&&", " and ").replace("||", " or ")


def _names(params: Mapping[str, Any]) -> dict[str, Any]:
    f = Formulas(params, np.float32)
    names: dict[str, Any] = {name: f[name] for name in parameters()}
    names |= {f"{loop}_{term}": f[f"{loop}_{term}"] for loop in ("D_CURRCNTR", "Q_CURRCNTR", "SPEEDCNTR") for term in ("PTERM", "ITERM", "CTERM")}
    names |= {"number": np.float32, "PARAM_F": np.float32, "PARAM_RS_FULL": f.rs(32768), "PARAM_LS_FULL": f.ls(4096), "PARAM_INVKFI": f.invkfi(),
              "PARAM_EMF_MAX_V": f.emf_max_v(), "PARAM_VOLTAGE_PER_BUS": f.voltage_per_bus(), "NORM_VOLTAGE_CONST": f.u0,
              "DUTY_PER_VOLT_NUMERATOR": int(f.duty_numerator()), "BUS_Q15": lambda volt: nearest(f.bus(volt)),
              "PARAM_SPEED_KI": lambda iterm: nearest(iterm * np.float32(16384))}
    return names


def check(params: Mapping[str, Any]) -> list[str]:
    """What the build would refuse about these parameters: ranges and relations, in its words."""
    missing = [name for name in parameters() if name not in params]
    if missing:
        return [f"{missing[0]} is missing"]
    values = _names(params)
    wrong = [relation.message for relation in relations()
             if not eval(_python(relation.condition), {"__builtins__": {}}, values)] # noqa: S307  the project's own header
    kphi_told = any(message.startswith("MOTOR_KPHI") for message in wrong)
    for p in parameters().values():
        inside = np.float32(float(p.low)) <= values[p.name] <= np.float32(float(p.high))
        if not inside and not (kphi_told and params[p.name] == "NORM_INVKFIBASE"):
            wrong.append(f"{p.name} = {params[p.name]} is outside {p.low} .. {p.high} {p.unit}")
    return wrong
