"""Rules of ``method(auto)``: the first row whose `when` is true is chosen.

`when` gets the facts of the scene (:class:`karamelo_py.advice.choosing.Scouted`). Attributes of the
facts replace names in braces in `lines`. `evidence` lists the scenes on which the row is based.
Studies compare the chosen row with `ALTERNATIVES`.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from karamelo_py.points.laws.eos.fluid import STRONG


class Choice(NamedTuple):
    when: Callable[[Any], Any]
    lines: tuple[str, ...]
    scene: str
    why: str
    evidence: tuple[str, ...]
    of_scheme: str = ""  # a reason that holds only with the scheme of `lines`

    def reason(self, lines: Sequence[str]) -> str:
        """Return the reason for `lines`, which lack the scheme if the script names another."""
        with_scheme = any(line.startswith("scheme(") for line in lines)
        return "; ".join(filter(None, (self.why, self.of_scheme * with_scheme)))


CHOICES = (
    Choice(
        lambda s: s.implicit and s.elastic_only and s.alone and s.weighed and s.blocks,
        ("method(tlmpm, FLIP, quadratic-spline, 1)",),
        "load steps of an elastic block with a body force",
        "stress varies within cells, and with a linear basis it is constant there",
        ("in.static_column",),
    ),
    Choice(
        lambda s: s.implicit and s.elastic_only and s.alone,
        ("method(tlmpm, FLIP, linear, 1)",),
        "load steps of an elastic body",
        "points stay in their cells, so a linear basis is second order",
        ("in.elastica", "in.rotor"),
    ),
    Choice(
        lambda s: s.limit_load and s.alone,
        ("method(tlmpm, FLIP, Bernstein-quadratic, 1)",),
        "load steps of soil up to its limit load",
        "a quadratic basis with two points per direction does not lock",
        ("in.cut", "in.static_footing", "in.static_slope"),
    ),
    Choice(
        lambda s: s.implicit and s.soil and s.dilates,
        ("method(ulmpm, FLIP, linear, 1)", "anti_volumetric_locking(true)"),
        "load steps of soil that other bodies load",
        "F-bar avoids locking in plastic flow",
        ("in.static_rough_footing",),
    ),
    Choice(
        lambda s: s.implicit and s.alone and not s.soil,
        ("method(tlmpm, FLIP, linear, 1)", "anti_volumetric_locking(true)"),
        "load steps of a metal that flows",
        "F-bar avoids locking in plastic flow, and points stay in their cells",
        ("in.thick_cylinder", "in.cavity"),
    ),
    Choice(
        lambda s: s.implicit and s.alone and not s.soil,
        ("method(tlmpm, FLIP, linear, 1)",),
        "load steps of a thin metal sheet that flows",
        "a sheet can become thinner, so it does not lock",
        ("in.disk",),
    ),
    Choice(
        lambda s: s.implicit,
        ("method({grid}, FLIP, quadratic-spline, 1)",),
        "load steps of soil that does not dilate, or of several bodies",
        "limit loads are closer than with a linear basis, and soil may flow",
        ("in.static_collapse",),
    ),
    Choice(
        lambda s: s.wet and s.elastic_only and s.alone,
        ("method(tlmpm, FLIP, linear, 1)",),
        "elastic soil with pore water",
        "points stay in their cells, and pressures are not smoothed",
        ("in.terzaghi",),
    ),
    Choice(
        lambda s: s.wet,
        ("method(ulmpm, FLIP, quadratic-spline, 0.999)",),
        "soil with pore water that flows, or that other bodies touch",
        "effective pressures have little noise, and FLIP 0.99 shortens run-outs by 30 %",
        ("in.wet_column",),
    ),
    Choice(
        lambda s: s.gas and s.thins,
        ("method({grid}, FLIP, quadratic-spline, 1)", "scheme(usavg)"),
        "a gas under high pressure in a small part of the space",
        "volumes of points more than a cell apart remain right with FLIP",
        ("in.blast",),
    ),
    Choice(
        lambda s: s.gas and s.speed > 1 and s.d > 1 and s.diffuses,
        ("method(ulmpm, TPIC, cubic-spline)", "scheme(usavg)", "dt_factor(0.6)"),
        "a gas that moves faster than its waves, with an artificial heat flux",
        "",
        ("in.noh",),
        "densities behind the shock are the closest",
    ),
    Choice(
        lambda s: s.gas and s.speed > 1 and s.d > 1,
        ("method(ulmpm, FLIP, quadratic-spline, 1)", "scheme(usavg)"),
        "a gas that moves faster than its waves",
        "",
        ("in.noh",),
        "densities behind the shock are the closest without a heat flux",
    ),
    Choice(
        lambda s: s.gas and s.calm,
        ("method(tlmpm, APIC, linear)", "scheme(usl)"),
        "slow waves in a gas, or a gas that expands from rest",
        "points have the same neighbours, so a linear basis is second order, and gas that expands "
        "does not separate",
        ("in.organ", "in.expansion"),
    ),
    Choice(
        lambda s: s.gas and s.alone and s.d == 1 and (s.burns or s.pressed or s.speed > 0.1),
        ("method(tlmpm, TPIC, quadratic-spline)",),
        "shocks or a detonation in one gas in one dimension",
        "points stay in their cells, and TPIC does not oscillate after a shock",
        ("in.tnt_slab", "in.noh_plane"),
    ),
    Choice(
        lambda s: s.gas and len(s.soft) == 1 and s.speed < 0.1 and not s.burns,
        ("method(ulmpm, APIC, cubic-spline, mass=corrected)",),
        "slow flow of a gas",
        "corrected accelerations retain steep waves without artificial viscosity",
        ("in.piston",),
    ),
    Choice(
        lambda s: s.gas and s.pressure_ratio < STRONG and s.grid == "ulmpm" and not s.burns,
        ("method(ulmpm, APIC, cubic-spline)", "scheme(usl)"),
        "shocks in a gas, with pressures at the start in a ratio below 20",
        "APIC oscillates least after a shock",
        ("in.sod",),
        "usl needs half as many passes over the points as musl",
    ),
    Choice(
        lambda s: s.gas,
        ("method({grid}, APIC, cubic-spline)",),
        "strong shocks in a gas",
        "APIC oscillates least after a shock, and with usl more energy would be lost",
        ("in.strong_shock",),
    ),
    Choice(
        lambda s: s.grains,
        ("method(ulmpm, AFLIP, cubic-spline, 0.9)", "anti_volumetric_locking(true)"),
        "dense granular flow",
        "F-bar evens out the pressures, and AFLIP 0.9 adds 10 % of the viscosity of APIC",
        ("in.plane_flow",),
    ),
    Choice(
        lambda s: s.liquid and s.sag > 0,
        ("method({grid}, AFLIP, quadratic-spline, 1)",),
        "a liquid under its weight",
        "surface waves and fronts lose the least energy with AFLIP",
        ("in.slosh", "in.dam_ritter"),
    ),
    Choice(
        lambda s: s.liquid,
        ("method({grid}, PolyPIC/quadratic, cubic-spline)",),
        "a liquid",
        "vortices lose least energy, and angular momentum is conserved",
        ("in.taylor_green", "in.couette"),
    ),
    Choice(
        lambda s: s.soil and s.pressed and s.alone and s.dilates,
        ("method(tlmpm, FLIP, linear, 0.99)", "anti_volumetric_locking(true)"),
        "soil that fixes press towards its limit load",
        "F-bar avoids locking in plastic flow, and points stay in their cells",
        ("in.footing_friction", "in.footing"),
    ),
    Choice(
        lambda s: s.soil,
        ("method({grid}, FLIP, quadratic-spline, 0.99)",),
        "soil that may flow",
        "gradients are continuous where points cross cells",
        ("in.collapse", "in.slump"),
    ),
    Choice(
        lambda s: s.shocked and not s.elastic_only and s.alone and len(s.soft) > 1,
        ("method(tlmpm, FLIP, linear, 0.99)", "anti_volumetric_locking(true)"),
        "a shock in bodies with a fix for contact between their points",
        "such a fix needs a grid for each body, FLIP 0.99 damps oscillations, and F-bar avoids "
        "locking in plastic flow",
        ("in.cold_spray",),
    ),
    Choice(
        lambda s: s.shocked and not s.elastic_only,
        ("method({grid}, APIC, cubic-spline)",),
        "a shock",
        "FLIP oscillates after shocks; other bases lose pressure where stressed points cross cells",
        ("in.plates", "in.flyer"),
    ),
    Choice(
        lambda s: not s.elastic_only and s.alone and s.narrow,
        ("method(tlmpm, APIC, linear)",),
        "a sheet or rod of metal that flows",
        "thin metal does not lock, and APIC does not oscillate after waves",
        ("in.impact", "in.plastic_wave"),
    ),
    Choice(
        lambda s: not s.elastic_only,
        ("method({grid}, FLIP, linear, 0.99)",),
        "a metal that flows",
        "the cheapest basis that does not lock",
        ("in.taylor_bar", "in.billet"),
    ),
    Choice(
        lambda s: s.loaded_slowly and s.alone and s.d == 1 and s.hub.domain.kin.hoops,
        ("method(tlmpm, FLIP, Bernstein-quadratic, 1)",),
        "elastic tube or shell in one dimension, loaded slowly",
        "hoop stresses vary within cells",
        ("in.lame", "in.shell"),
    ),
    Choice(
        lambda s: s.loaded_slowly and s.alone and s.d < 3 and s.blocks,
        ("method(tlmpm, FLIP, quadratic-spline, 1)",),
        "one elastic block that is held and loaded slowly",
        "points stay in their cells, and stress varies within cells",
        ("in.column", "in.cantilever"),
    ),
    Choice(
        lambda s: s.alone and s.weighed,
        ("method(tlmpm, PolyPIC, linear)", "scheme(usl, start=half)"),
        "elastic bodies with a body force, alone or with a fix for their contact",
        "points stay in their cells, so a linear basis is second order and conserves energy and "
        "angular momentum",
        ("in.throw", "in.vertical_bar"),
        "start=half, so that the path of a projectile is exact",
    ),
    Choice(
        lambda s: s.alone,
        ("method(tlmpm, PolyPIC, linear)", "scheme(usl)"),
        "elastic bodies, alone or with a fix for their contact",
        "points stay in their cells, so a linear basis is second order and conserves energy and "
        "angular momentum",
        ("in.energy_disk", "in.turns", "in.axis_aligned"),
        "usl needs half as many passes over the points as musl",
    ),
    Choice(
        lambda s: s.rolls,
        ("method(ulmpm/contacts, APIC, quadratic-spline)",),
        "elastic bodies that roll",
        "angular momentum is conserved; FLIP slows the rotation",
        ("in.incline",),
    ),
    Choice(
        lambda s: s.rubs and len(s.soft) == len(s.hub.solids),
        ("method(ulmpm/contacts, FLIP, cubic-spline, 0.99)",),
        "elastic bodies that slide on each other, none of them rigid",
        "with a linear basis, friction on inclined faces that deform is up to 3 % too large",
        ("in.slope_20_soft",),
    ),
    Choice(
        lambda s: s.rubs,
        ("method(ulmpm/contacts, FLIP, linear, 0.99)",),
        "elastic bodies that slide on rigid ones",
        "friction is correct within 1 %, also on inclined faces",
        ("in.slope_20", "in.slope_33", "in.slide"),
    ),
    Choice(
        lambda s: s.led and s.grid == "ulmpm/contacts",
        ("method(ulmpm/contacts, APIC, quadratic-spline)",),
        "elastic bodies pressed by a moving rigid body",
        "splines follow the surface more closely, and APIC damps vibrations",
        ("in.hertz",),
    ),
    Choice(
        lambda s: s.grid == "ulmpm/contacts",
        ("method(ulmpm/contacts, FLIP, linear, 1)", "scheme(usavg)"),
        "elastic bodies that meet",
        "the cheapest basis",
        ("in.rods", "in.punch"),
        "rebounds lose the least energy",
    ),
    Choice(
        lambda s: True,
        ("method(ulmpm, AFLIP, cubic-spline, 1, mass=corrected)",),
        "elastic bodies on one grid",
        "corrected accelerations, and hardly any noise where points cross cells",
        ("in.vibrating_bar",),
    ),
)  # fmt: skip
PLAIN = Choice(
    lambda s: True,
    ("method(ulmpm, FLIP, quadratic-spline, 0.99)",),
    "a scene that no row of the table suits",
    "",
    (),
)
RESUMED = PLAIN._replace(scene="the run that wrote the restart file")
BY_RULES = "rules"  # name of the row that the rules choose
ALTERNATIVES = {
    "linear": ("method({grid}, FLIP, linear, 0.99)",),
    "quadratic": ("method({grid}, FLIP, quadratic-spline, 0.99)",),
    "APIC-quadratic": ("method({grid}, APIC, quadratic-spline)",),
    "APIC-cubic": ("method({grid}, APIC, cubic-spline)",),
    "corrected": ("method({grid}, APIC, cubic-spline, mass=corrected)",),
    "total": ("method(tlmpm, PolyPIC, linear)", "scheme(usl)"),
    "total-quadratic": ("method(tlmpm, FLIP, Bernstein-quadratic, 1)",),
}
