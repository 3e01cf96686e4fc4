"""Where the models are found."""

import pytest
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import add_models_to, models_directory, resolve_model

DIRECTORY = models_directory() / "comau_racer_1_4"


def test_package_address_resolves():
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    add_models_to(parser.package_map())
    add_models_to(parser.package_map())  # a second time is fine
    address = "package://pfsc_models/comau_racer_1_4/comau_racer_1_4.sdf"
    parser.AddModelsFromUrl(address)
    plant.Finalize()
    assert plant.num_positions() == 6
    assert resolve_model(address) == DIRECTORY / "comau_racer_1_4.sdf"
    package_map = PackageMap()
    package_map.AddPackageXml(str(models_directory() / "package.xml"))
    assert package_map.Contains("pfsc_models")


def test_resolves_names_and_paths(tmp_path):
    assert resolve_model("comau_racer_1_4_3r") == DIRECTORY / "comau_racer_1_4_3r.sdf"
    own = tmp_path / "own.urdf"
    own.write_text("<robot name='own'/>", encoding="utf-8")
    assert resolve_model(own) == own
    with pytest.raises(InputError, match="comau_racer_1_4_elastic_3r"):
        resolve_model("comau_racer")
    with pytest.raises(InputError, match="no such file"):
        resolve_model(tmp_path / "other.sdf")
    with pytest.raises(InputError, match="no such file"):
        resolve_model("package://pfsc_models/comau_racer_1_4/none.sdf")
