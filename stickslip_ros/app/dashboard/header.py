"""Head of the page: regime, what is waited for, the view, and the facts of the run."""

from pathlib import Path

from nicegui import ui

from stickslip_ros.app.dashboard.elements import call, heading
from stickslip_ros.app.dashboard.ended_run import EndedRun
from stickslip_ros.app.dashboard.frames import PERIODS
from stickslip_ros.app.dashboard.listener import ListenerNode
from stickslip_ros.app.dashboard.run_state import ABSENT, SILENT
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.nodes.base.managed import NEWEST_STAMP
from stickslip_ros.show import GREY
from stickslip_ros.show.regimes import REGIMES
from stickslip_ros.text import number_in


class Header:
    """Name and regime of the run, alerts, the buttons of the view, and a line of facts."""

    def __init__(self, listener: ListenerNode, ended: EndedRun) -> None:
        """Add the head of the page."""
        self._run, self._listener, self._ended = listener.run, listener, ended
        self._regime_colour = ""
        self._description = "", "", ""
        self._paused = False
        with ui.row().classes("w-full items-center"):
            heading(1, self._run.namespace).classes("text-2xl")
            self._regime = ui.label("").classes("regime")
            self._wait = ui.label("").props("role=status")
            self._trouble = ui.label("").classes("refusal").props("role=alert")
            ui.link("Controls", "#controls").classes("to-controls")
            ui.space()
            window = ui.toggle(
                {periods: f"{periods} periods" for periods in PERIODS},
                value=PERIODS[1],
                on_change=lambda event: call("show", event.value),
            )
            window.props("no-caps outline")
            self._view = ui.button("Pause view", on_click=self._pause_view).props("outline no-caps")
            texts = "Fit", "CSV", "PNG"
            fit, csv, png = (ui.button(text).props("outline no-caps") for text in texts)
            fit.on("click", js_handler="() => stickslip.fit()")  # also after the server has ended
            csv.on("click", js_handler="() => stickslip.csv()")
            png.on("click", js_handler="() => stickslip.png()")
            self._facts = ui.label("").classes("w-full text-sm break-words")

    @property
    def regime(self) -> str:
        """The regime as it is shown."""
        return self._regime.text

    def refresh(self, *, switching: bool, settings: str) -> None:
        """Show the run, whether its controller is being switched, and its `settings` in words."""
        self._show_regime()
        self._show_waits(switching)
        self._show_facts()
        self._describe(settings)

    def _show_regime(self) -> None:
        analyzer = self._run.health["analyzer"]
        regime = analyzer.figures.get("regime") if analyzer.state == "active" else None
        known = regime in list(Regime)
        look = REGIMES[Regime(regime) if known else None]
        trend = analyzer.figures.get("trend") if known else None
        if trend:  # the motion differs from the cycles that the regime is taken from
            self._regime.set_text(f"not steady: {trend}")
        elif known:
            self._regime.set_text(look.label)
        else:
            self._regime.set_text("run ended" if self._listener.ended else "not measured")
        colour = GREY if trend else look.colour
        if colour != self._regime_colour:
            self._regime_colour = colour
            self._regime.style["border-color"] = colour
            self._regime.update()

    def _show_waits(self, switching: bool) -> None:
        run, text = self._run, ""
        if (left := run.acts_in) > 0.0:
            text = f"control acts in {left:.1f} {run.units.of_unit('s')}".rstrip()
        elif (left := run.waits_for_reply) > 0.0:
            text = f"waiting for the controller, {left:.0f} s"
        elif switching:
            text = "waiting for the controller"
        self._wait.set_text(text)
        missing = [
            f"{node} {health.state}"
            for node, health in run.health.items()
            if health.state in (ABSENT, SILENT)
        ]
        self._trouble.set_text("" if self._listener.ended else ", ".join(missing))

    def _show_facts(self) -> None:
        run, figures, bag = self._run, self._run.health["plant"].figures, self._bag
        samples = number_in(figures.get("samples", ""))
        late = [
            f"{name.replace('_', ' ')} {100.0 * number_in(figures[name]) / samples:.2g} %"
            for name in ("late_forces", "missed_deadlines")
            if samples and figures.get(name)
        ]
        # A page that does not keep up with a fast run may miss its last samples.
        newest = max(run.newest, number_in(figures.get(NEWEST_STAMP, "")))
        since = f"t = {run.units.text(run.time_of(newest), 's')}"
        recording = "recording to" if run.health["analyzer"].state == "active" else "bag"
        recorded = f"{recording} {bag}" if bag else "not recorded"
        self._facts.set_text(", ".join(filter(None, (since, *late, recorded, run.command))))

    @property
    def _bag(self) -> str:
        return Path(self._ended.bag).name

    def _describe(self, settings: str) -> None:
        """Tell page.js the command, the bag and the settings, by which it names downloads."""
        run, name = self._run, self._run.namespace
        description = run.command or name, self._bag or name, settings
        # A run that ends switches control off, after the motion; a paused view is of before.
        ends = self._description[0] and run.health["plant"].state != "active"
        if description != self._description and not (ends or self._paused):
            self._description = description
            call("describe", *description)

    def _pause_view(self) -> None:
        self._paused = not self._paused
        self._view.set_text("Continue view" if self._paused else "Pause view")
        call("pause", self._paused)
