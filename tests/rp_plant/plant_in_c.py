"""The plant's struct model and its struct of values, from the libraries of the build, by ctypes."""

import ctypes
import subprocess
from pathlib import Path
from typing import Any

from tests.equations.compiled import BUILD, Words
from tests.support.paths import ROOT
from tests.support.plain_equations import Array, PlainEquations, Structure, is_whole

PLANT = ROOT / "models" / "rp_plant"
LIBRARIES = [BUILD / "libRPPlant_equations.a", BUILD / "models" / "rp_plant" / "librp_plant.a"]
SHOWN = "extern const char rp_plant_model[]; const char *const shown = rp_plant_model;"
BACKWARD, STUCK, FORWARD, FREE = -1, 0, 1, 2
UNDECIDED, ATTACHED, RELEASED = range(3)
NONE, RIGID, COMPLIANT = 1, 2, 3


class PlantInC:
    """words: of struct model; plant: the type of struct rp_plant_values."""

    def __init__(self, folder: Path) -> None:
        self.plain = PlainEquations(PLANT / "rp_plant_calculated.h", "rp_plant_calculate")
        library = folder / "plant.so"
        command = ["cc", "-shared", "-fPIC", "-xc", "-", "-xnone", "-o", library]
        command += ["-Wl,--start-group", *LIBRARIES, "-Wl,--end-group", "-lm"]
        subprocess.run(command, input=SHOWN, text=True, check=True)
        self.library = ctypes.CDLL(str(library))
        self.words = Words.from_address(ctypes.c_size_t.in_dll(self.library, "shown").value)
        row_count, rows, _ = (ctypes.c_size_t * 3).from_address(self.words.series)
        self.row_count, self.row_of_indicator = row_count, (ctypes.c_size_t * 10).from_address(rows)
        self.plant = self._type(Structure("rp_plant_values"))

    def _type(self, kind: Any) -> Any:
        """The type in ctypes."""
        if isinstance(kind, Array):
            return self._type(kind.of) * kind.length
        if not isinstance(kind, Structure):
            return ctypes.c_int if is_whole(kind) else ctypes.c_double
        fields = self.plain.interpreter.types.fields(kind, None)
        listed = [(name, self._type(of)) for name, of in fields.items()]
        return type(kind.name, (ctypes.Structure,), {"_fields_": listed})
