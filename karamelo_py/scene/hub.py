"""The hub: the state of a scene, for commands and styles (Karamelo's class Pointers)."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from karamelo_py.kernels.equations.move import VelocityBefore
from karamelo_py.language import registry
from karamelo_py.language.faults import as_script_error
from karamelo_py.language.unknown import line_below, words_of
from karamelo_py.output.console import Console
from karamelo_py.output.fields import Fields
from karamelo_py.output.record import RunRecord
from karamelo_py.output.schedule import Output
from karamelo_py.points.transfers import flip_coefficient, stores_moment
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.domain import Domain, no_domain
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.plugins import attributed
from karamelo_py.schemes.musl import MUSL
from karamelo_py.script.errors import Mark, ScriptError, meant, nearest, render_message
from karamelo_py.script.values import Values


class Catalogue(dict):
    """Parts by name, in the order of creation; a new part gets an ``id`` and a ``mark``."""

    def __init__(self, kind: str, hub: Hub):
        super().__init__()
        self.kind = kind
        self.hub = hub

    def add(self, ID: str, item: Any, *, replace: bool = False) -> Any:
        if not replace:
            self.refuse(ID)
        item.id, item.mark = ID, self.hub.mark
        self[ID] = item
        return item

    def refuse(self, ID: str) -> None:
        if ID in self:
            before = self[ID].mark
            where = f" (line {before.line})" if before else ""
            raise ScriptError(
                f"ID '{ID}' is already used{where}",
                argument="ID",
                code="already-used",
                kind=self.kind,
                expected="another ID",
                hint=f"modify({self.kind}, {ID}, name=value) changes its constants"
                if self.kind in ("material", *PARTS)
                else None,
            )

    def refuse_unnameable(self, ID: str) -> None:
        if ID.isidentifier() and ID not in ("and", "or", "not"):
            return
        better = re.sub(r"\W", "_", ID)
        better = better if better.isidentifier() and better != ID else f"{self.kind[0]}{better}"
        message = f"formulas could not name the values of {self.kind} '{ID}'"
        expected = "letters, digits and _, beginning with a letter"
        raise ScriptError(message, argument="ID", expected=expected, hint=f"such as {better}")

    def __missing__(self, ID: str) -> NoReturn:
        names = [*["all"] * (self.kind == "group"), *self]
        other = next((c.kind for c in self.hub.catalogues if ID in c and c.kind != self.kind), None)
        below = line_below(self.hub.interpreter, self.kind, ID)
        hint = meant(ID, names)
        if self.kind == "group" and (near := nearest(ID, [*self.hub.solids, *self.hub.regions])):
            kind = "solid" if near in self.hub.solids else "region"
            hint = f"{near} is a {kind}, not a group; all is the group of all points"
        if self.kind == "group" and other in ("region", "solid"):
            filled = self.hub.solids[ID].region if other == "solid" else None
            region = "regionID" if filled is None else filled.id
            who = f"{ID}, all" if other == "region" else f"{region}, solid, {ID}"
            hint = f"group({ID}, particles, region, {who}) makes a group of a {other}"
        statement = self.hub.interpreter.statement
        first, *words = words_of(statement) or [""]
        if self.kind == "group" and first in names and words[1:2] == [ID]:
            hint = f"{statement.name}({', '.join([ID, words[0], first, *words[2:]])})"
        if below is not None:
            hint = f"{self.kind} '{ID}' is defined further down: move line {below} up"
        raise ScriptError(
            f"unknown {self.kind} '{ID}'" + (f"; '{ID}' is a {other}" if other else ""),
            code="unknown-ID",
            name=ID,
            kind=self.kind,
            expected=f"one of {', '.join(names)}" if names else f"no {self.kind} is defined yet",
            hint=hint,
        )

    def remove(self, ID: str) -> None:
        self[ID]
        del self[ID]


class Parts(dict):
    def __init__(self, hub: Hub):
        self.hub = hub
        super().__init__((k, Catalogue(k, hub)) for k in PARTS)

    def __missing__(self, kind: str) -> Catalogue:
        return self.setdefault(kind, Catalogue(kind, self.hub))


PARTS = ("eos", "strength", "damage", "temperature")


class Settings:
    def __init__(self) -> None:
        self.threads: int | None = None
        self.precision = "double"
        self.engine = "processor"
        self.card: Any = None
        self.ranks = 1
        self.comm = SerialComm()
        self.debug = False
        self.trusts = False  # whether .geo files may run programs


class Update:
    remembers = ("warned_of_bounces", "warned_of", "above_waves")

    def __init__(self, values: Values):
        self.values = values
        self.method: Any = None
        self.chosen: Any = None  # `advice.choosing.Chosen`, set by method(auto)
        self.transfer: Any = None
        self.scheme: Any = MUSL()
        self.scheme_mark: Mark | None = None
        self.scheme_behind = 0  # number of runs before the scheme was chosen
        self.thermal = False
        self.anti_locking = False  # F-bar
        self.half_start = False  # the first kick lasts half a step
        self.fixed_dt: float | None = None  # set_dt; None: adaptive
        self.dt_factor: float | None = None  # fraction of the stable step; None: automatic
        self.dt_mark: Mark | None = None
        self.boundary = "error"
        self.boundary_mark: Mark | None = None
        self.warned_of_bounces = False
        self.warned_of: list[str] = []
        # Largest speed / wave speed, and the wave speed, if a run began with supersonic points.
        self.above_waves: list[float] = []
        self.moving: tuple[list[Any], float] = ([], 0.0)  # fixes of the last run; its start

    def first_time(self, name: str) -> bool:
        first = name not in self.warned_of
        self.warned_of += [name] * first
        return first

    @property
    def point_fields(self) -> tuple[type, ...]:
        before = (VelocityBefore,) if self.half_start else ()
        loss = self.scheme.traits.loss
        return (*before, loss) if loss and self.loses_in_transfer else before

    @property
    def loses_in_transfer(self) -> bool:
        """Return True if the loss of the transfer is counted, even if no compute asks for it."""
        transfer, loss = self.transfer, self.scheme.traits.loss
        if transfer is None or self.scheme.traits.implicit or loss is None:
            return False
        # Other losses need a further loop over the nodes of each point.
        further = stores_moment(transfer) or loss.work_with_update
        further = further or transfer.traits.series
        return not further and flip_coefficient(transfer) < 1

    @property
    def words(self) -> str:
        scheme = _with_numbers(registry.name_of("scheme", type(self.scheme)), self.scheme)
        more = " thermo-mechanical" * self.thermal + " mass=corrected" * self.method.corrected
        return f"{self.words_of_state} {scheme}{more}"

    @property
    def words_of_state(self) -> str:
        method = registry.name_of("method", type(self.method))
        transfer = _with_numbers(registry.name_of("transfer", type(self.transfer)), self.transfer)
        return f"{method} {transfer} {_with_numbers(self.method.basis_name, self.method.basis)}"

    @property
    def step(self) -> int:
        return int(self.values.get("timestep"))

    @property
    def time(self) -> float:
        return self.values.get("time")

    @property
    def dt(self) -> float:
        return self.values.get("dt")

    def transfer_tag(self, real: type) -> Any:
        return type(self.transfer)(*(real(x) if isinstance(x, float) else x for x in self.transfer))


def _with_numbers(name: str, tag: NamedTuple) -> str:
    numbers = ", ".join(
        f"{key} {value:g}" if isinstance(value, (int, float)) else f"{key} {value}"
        for key, value in tag._asdict().items()
    )
    return name + (f" ({numbers})" if numbers else "")


class Hub:
    def __init__(self, console: Console | None = None):
        self.console = console or Console()
        self.settings = Settings()
        self.folder = Path.cwd()
        self.mark: Mark | None = None
        # In a rehearsal no steps are taken and no files are written.
        self.rehearsing = False
        self.rehearsed = False
        self.scouting = False  # ends the rehearsal at the first run
        self.begun = 0  # runs begun, including those in the rehearsal
        self.answered = False  # the script has printed or written something
        self.checking = False  # True for ``check``: the first run only reports
        self.pausing = False  # stops before runs, for a Python program that controls them
        self.open_ended = False  # a Python program may add commands after the script
        self.in_runs: list[Any] = []
        self.at_end: Hub | None = None  # the scene at the end of the script, in a check
        self.interpreter: Any = None
        self.restart: Any = None  # restart file, until the script has rebuilt the scene
        self.domain: Any = None
        self.announced_dimension: int | None = None
        self.regions = Catalogue("region", self)
        self.parts = Parts(self)
        self.materials = Catalogue("material", self)
        self.load_paths = Catalogue("load path", self)
        self.elements = Catalogue("element", self)
        self.solids = Catalogue("solid", self)
        self.groups = Catalogue("group", self)
        # Ids of points that enter later, and of points that the script has deactivated.
        self.waiting, self.inactive = np.empty((2, 0), np.int64)
        self.fixes = Catalogue("fix", self)
        self.computes = Catalogue("compute", self)
        self.dumps = Catalogue("dump", self)
        self.values = Values()  # published by fixes and computes; time, timestep, dt
        self.update = Update(self.values)
        self.output = Output(self)
        self.fields = Fields(self)
        self.asked: set[str] = set()  # values and columns that statements use
        self.functions: dict[str, Any] = {}  # Python functions passed by a program
        self.in_run = 0
        self.listeners: list[Any] = []  # `run.listening.Listener`
        self._fits_run = 0  # number of the last run whose arrays still describe the scene
        self.runs: list[dict[str, float]] = []
        self.record = RunRecord()
        self.warned: list[tuple[float, str]] = []
        self.later: list[Any] = []  # `known_failures.Step` of later runs, as found in the rehearsal
        self._simulation: Any = None
        self._lattices: tuple[tuple, list[Lattice]] | None = None

    @property
    def catalogues(self) -> list[Catalogue]:
        mine = [item for item in vars(self).values() if isinstance(item, Catalogue)]
        return [*self.parts.values(), *mine]

    @property
    def has_run(self) -> bool:
        """True after a run has begun; in a rehearsal, also before a run that will begin."""
        return bool(self.begun or self.update.step)

    @property
    def simulation(self) -> Any:
        run, current = self.in_run, self._simulation
        if current is not None and run and run == self._fits_run:
            return current
        self._fits_run = run
        if current is None or not current.fits(self):
            name = self.settings.engine
            implicit = name == "processor" and self.update.scheme.traits.implicit
            engine = registry.find("engine", "implicit" if implicit else name)
            with attributed(self):
                self._simulation = engine(self, self._simulation)
        return self._simulation

    @property
    def scheme_of_steps(self) -> Any:
        """The scheme of the steps, which may depend on whether fixes move deformable points."""
        led = (fix for fix in self.fixes.values() if fix.leads_points and not fix.of_rigid_points)
        leading = self.update.scheme.traits.leading
        return self.update.scheme if leading is None or next(led, None) is None else leading

    @property
    def lattices(self) -> list[Lattice]:
        """Return the grids of the method; without a method, the grid of the domain."""
        key, method = self._key_of_lattices, self.update.method
        if self._lattices is None or self._lattices[0] != key:
            self._lattices = key, method.lattices(self) if method else [self.domain.lattice]
        return self._lattices[1]

    @property
    def _key_of_lattices(self) -> tuple:
        return (
            self.domain,
            self.domain.h,
            self.domain.periodic,
            self.update.method,
            *self.solids.values(),
        )

    def require_domain(self) -> Domain:
        if self.domain is None:
            raise no_domain(self)
        return self.domain

    def forget_simulation(self) -> None:
        self._simulation = None
        self._lattices = None

    def refresh_values(self) -> None:
        for catalogue in (self.computes, self.fixes):
            for item in catalogue.values():
                name = f"{catalogue.kind} {item.style}"
                with as_script_error(name, "refresh", type(item), item.mark):
                    item.refresh()
                if catalogue is self.computes and item.published and not item.has_published:
                    item.has_published = True
                    self.warn(
                        f"{name} has not published anything: "
                        f"{item.id}_{item.published[0]} is 0".replace("_ ", " "),
                        item.mark,
                        hint="in the plug-in, call self.publish in refresh, or set published = ()",
                    )
        # Published values of all processes must agree, even if a plug-in draws random numbers.
        self.values.array[:] = self.settings.comm.bcast(self.values.array)

    def warn(
        self,
        message: str,
        mark: Mark | None = None,
        hint: str | None = None,
        expected: str | None = None,
        *,
        code: str = "",
        cause: str = "",
    ) -> None:
        if not self.rehearsing:
            self.record.warn(message, hint, mark or self.mark, code, cause)
            text = render_message(
                "warning", message, mark or self.mark, expected, hint, code=code, cause=cause
            )
            self.warned.append((self.update.time, text))
            self.console.warn(text)

    def rehearse(self) -> None:
        """Read the rest of the script once to find errors before any expensive work."""
        if not self.rehearsed:
            self.rehearsed = True
            other = self.rehearsal() if self.interpreter.has_more else self
            other.in_runs = self.lasting()
            if other is not self:
                self.interpreter.rehearse(other)
                self.later = other.later
                self.at_end = other if self.checking else None
            self._tell_of_late(other)

    def lasting(self) -> list[Any]:
        return [*self.fixes.values(), *self.dumps.values(), *self.output.plots.values()]

    def _tell_of_late(self, rehearsed: Hub) -> None:
        curve = next(iter(rehearsed.output.plots.values()), None)
        if curve is not None and rehearsed.output.plots.file is None and not self.open_ended:
            self.warn(
                f"plot '{curve.id}' is not drawn: the script has no save_plot",
                curve.mark,
                hint="save_plot(curves.png)",
            )
        seen = {id(item) for item in rehearsed.in_runs}
        for item in () if self.open_ended else rehearsed.lasting():
            if id(item) not in seen and item.mark is not None:
                kind = next((c.kind for c in rehearsed.catalogues if item.id in c), "plot")
                self.warn(
                    f"{kind} '{item.id}' follows the last run, and has no effect",
                    mark=item.mark,
                    hint="define it before the run that needs it",
                )

    def rehearsal(self) -> Hub:
        other = copy.copy(self)
        other.rehearsing = True
        other.parts = Parts(other)
        for kind, mine in self.parts.items():
            other.parts[kind].update(mine)
        for name, mine in vars(self).items():
            if isinstance(mine, Catalogue):
                catalogue = Catalogue(mine.kind, other)
                catalogue.update(mine)
                setattr(other, name, catalogue)
        other.settings = copy.copy(self.settings)
        other.values = copy.deepcopy(self.values)
        other.update = copy.copy(self.update)
        other.update.values = other.values
        other.update.warned_of = list(self.update.warned_of)
        other.output = Output(other)
        other.output.files = dict(self.output.files)
        other.output.log.file = self.output.log.file
        other.output.plots.update(self.output.plots)
        other.output.plots.file = self.output.plots.file
        other.fields = Fields(other)
        other.runs, other.later = list(self.runs), []
        other._copy_bodies(self)
        return other

    def _copy_bodies(self, real: Hub) -> None:
        self.domain = copy.copy(real.domain)
        copies: dict[Any, Any] = {}
        for ID, solid in real.solids.items():
            mine = copies[solid] = self.solids[ID] = copy.copy(solid)
            mine.domain, mine.glued_to = self.domain, copies.get(solid.glued_to)
        for ID, group in real.groups.items():
            mine = self.groups[ID] = copy.copy(group)
            mine.hub = self
        if real._lattices is not None:
            self._lattices = self._key_of_lattices, real._lattices[1]
