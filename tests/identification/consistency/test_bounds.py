"""Files of bounds, and bounds and priors from what little is known."""

import numpy as np
import pytest

from identification.consistency.bounds import bounds_from_geometry, link_intervals, load_bounds
from identification.consistency.parameter_files import inconsistencies
from identification.consistency.pseudo_inertia import spread
from identification.consistency.semidefinite_program import check_prior, prior_from_bounds
from identification.model.dynamic_parameters import parameter_names, true_parameters
from pfsc_drake.errors import InputError


@pytest.mark.parametrize("name", ["comau", "panda", "delta"])
def test_shipped_bounds_hold_for_the_shipped_robots(name, request):
    subject = request.getfixturevalue(name)
    bounds, parameters = load_bounds(subject.name), true_parameters(subject)
    for i, link in enumerate(bounds.links):
        own = parameters[10 * i : 10 * (i + 1)]
        G, lower, upper = link_intervals(link)
        assert np.all((lower <= G @ own) & (G @ own <= upper)), i
        assert spread(own)[0] >= link.least_extent
    if bounds.delta is not None:
        for mass, (least, largest) in zip(
            parameters[:4], [bounds.delta.slide] * 3 + [bounds.delta.plate], strict=True
        ):
            assert least <= mass <= largest


def test_body_box_is_about_the_second_moments():
    """Half of the mass at either end of a box is the most that fits into it."""
    link = load_bounds("comau_racer_1_4").links[0]
    center, width = link.center_of_mass.center, link.center_of_mass.half_widths
    link.body = link.center_of_mass
    rows, _, _ = link_intervals(link)
    for share, inside in ((0.99, True), (1.01, False)):
        second = np.outer(center, center) + np.diag((share * width) ** 2)
        inertia = np.trace(second) * np.eye(3) - second
        own = 50.0 * np.concatenate([[1.0], center, inertia[np.triu_indices(3)]])
        assert np.all(rows[-3:] @ own >= 0.0) == inside


@pytest.mark.parametrize("name", ["comau", "panda"])
def test_prior_in_the_middle_of_bounds_is_a_robot(name, request):
    subject = request.getfixturevalue(name)
    names = parameter_names(subject)
    for bounds in (load_bounds(subject.name), bounds_from_geometry(subject, (50.0, 90.0), 0.2)):
        prior = prior_from_bounds(names, bounds)
        assert np.all(np.isnan(prior[-2 * subject.dimension :]))
        assert inconsistencies(subject, np.nan_to_num(prior)) == []
        np.testing.assert_array_equal(check_prior(names, prior), prior)
        for i, link in enumerate(bounds.links):
            mass = prior[10 * i]
            assert link.mass[0] <= mass <= link.mass[1]
            np.testing.assert_allclose(
                prior[10 * i + 1 : 10 * i + 4] / mass, link.center_of_mass.center, atol=1e-12
            )


def test_true_robot_is_a_prior(comau):
    names = parameter_names(comau)
    prior = true_parameters(comau)
    np.testing.assert_array_equal(check_prior(names, prior), prior)
    rotorless = np.where(np.arange(78) == 60, 0.0, prior)
    with pytest.raises(InputError, match=r"prior: joint_1.I_M = 0; must be positive"):
        check_prior(names, rotorless)
    with pytest.raises(InputError, match=r"prior: link_2 has a parameter that is not finite"):
        check_prior(names, np.where(np.arange(78) == 13, np.nan, prior))
    with pytest.raises(InputError, match=r"prior: shape .77,.; must be .78,"):
        check_prior(names, prior[1:])
    massless = np.where(np.arange(78) == 20, 0.0, prior)
    with pytest.raises(InputError, match=r"prior: link_3 of 0 kg has no positive definite"):
        check_prior(names, massless)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mass: [2, 1]", r"links\[0\]\.mass = \[2.0, 1.0\]; allowed: \[least, largest\]"),
        ("mass: [0, 1]", r"mass = \[0.0, 1.0\]; allowed: \[least, largest\], both positive"),
        ("mass: [1]", r"mass = \[1.0\]; allowed: 2 finite numbers"),
        ("least_extent: 0", "least_extent = 0.0; allowed: a positive number"),
        ("center_of_mass: {lower: [0, 0, 1], upper: [1, 1, 1]}", "lower = .* allowed: below upper"),
        ("center_of_mass: {lower: [0, 0], upper: [1, 1, 1]}", "lower = .* allowed: 3 finite"),
        ("volume: 1", "volume"),
    ],
)
def test_bad_links(text, message, tmp_path):
    link = {
        "mass": "[1, 2]",
        "center_of_mass": "{lower: [0, 0, 0], upper: [1, 1, 1]}",
        "least_extent": "0.1",
    }
    key, value = text.split(": ", 1)
    link[key] = value
    write(tmp_path, f"name: a\nlinks: [{{{', '.join(f'{k}: {v}' for k, v in link.items())}}}]")
    with pytest.raises(InputError, match=rf"bounds\.yaml:2: .*{message}"):
        load_bounds(tmp_path / "bounds.yaml")


def write(folder, text):
    (folder / "bounds.yaml").write_text(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("links: []", "links = 0; allowed: one entry per link, or instead the key delta"),
        ("delta: {slide: [1, 2], plate: [1, 2]}", "links = 1; allowed: one entry per link"),
        ("rotor_inertia: [[1, 2], [1, 2]]", "rotor_inertia = 2; allowed: one interval per link, 1"),
        ("rotor_inertia: [[2, 1]]", r"rotor_inertia\[0\] = .* allowed: \[least, largest\]"),
        ("total_mass: [1]", "total_mass = .* allowed: 2 finite numbers"),
    ],
)
def test_bad_robots(text, message, tmp_path):
    write(tmp_path, f"name: a\n{text}\n")
    with pytest.raises(InputError, match=message):
        load_bounds(tmp_path / "bounds.yaml")


def test_unknown_robots(delta, panda):
    with pytest.raises(InputError, match="robot 'nobody': must be a file or one of comau_racer"):
        load_bounds("nobody")
    with pytest.raises(InputError, match="festo_expt_45: no chain of links"):
        bounds_from_geometry(delta, (1.0, 2.0), 0.1)
    with pytest.raises(InputError, match=r"margin = 0.0; allowed: positive and finite"):
        bounds_from_geometry(panda, (1.0, 2.0), 0.0)
    with pytest.raises(InputError, match=r"total_mass = .* both positive"):
        bounds_from_geometry(panda, (3.0, 2.0), 0.1)


def test_bounds_from_geometry_share_the_mass(comau):
    """A link weighs a tenth of an even share at least, and ten of them at most, but no more."""
    for total in ((50.0, 90.0), (100.0, 100.0)):
        for link in bounds_from_geometry(comau, total, 0.1).links:
            np.testing.assert_allclose(link.mass, [total[0] / 60.0, total[1]], rtol=1e-12)
            assert link.least_extent == pytest.approx(0.01)
