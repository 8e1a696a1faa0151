"""The closed loop of FMUs of FMI 3.0: the command takes it; what is refused, of either version."""

from pathlib import Path

import pytest

from rparm.errors import UserError
from rparm.systems import ssp
from tests.support.rparm_project import Console
from tests.support.ssp_files import SSP, edited, edited_fmu, replace

SSP3 = SSP.parent / "fmi3" / SSP.name


def test_the_command_takes_the_fmus_of_fmi_3(tmp_path: Path, console: Console) -> None:
    code, out, err = console("system", "nominal", "--fmi", "3", "--report", tmp_path)
    assert (code, err) == (0, "") and "passed: 1 variant; " in out
    assert "ClosedLoop (FMI 3.0)" in (tmp_path / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("source", [SSP, SSP3], ids=["2.0", "3.0"])
def test_what_ecos_would_not_set_is_refused(tmp_path: Path, console: Console, source: Path) -> None:
    """Enumerations of any version of FMI."""
    law = '<ssv:Parameter name="mode"><ssv:Integer value="1"/></ssv:Parameter>'
    added = replace("<ssv:Parameters>", f"<ssv:Parameters>{law}")
    path = edited(source, tmp_path / "law.ssp", {"resources/controller_nominal.ssv": added})
    error = console.failed("system", "nominal", "--ssp", path, "--report", tmp_path / "report")
    assert "component 'controller': 'mode' is an Enumeration, which Ecos does not set" in error


def test_another_version_of_fmi_is_refused(tmp_path: Path) -> None:
    change = edited_fmu({"modelDescription.xml": replace('fmiVersion="3.0"', 'fmiVersion="3.1"')})
    path = edited(SSP3, tmp_path / "later.ssp", {"resources/RPController.fmu": change})
    refused = r"component 'controller': .* an FMU of FMI 2\.0 or 3\.0 .*, found FMI 3\.1"
    with pytest.raises(UserError, match=refused), ssp.unpacked(path):
        pass
