"""Fig. 4: peak dynamic rail deflection along the track for the models of each vehicle.

Depends on: figures.style, units, views.vehicles.
"""

from matplotlib.figure import Figure

from mcsettle.figures.style import GREY, look, note, styled
from mcsettle.units import KMH, MM
from mcsettle.views.vehicles import MODEL_TITLES, VehiclePeaks


@styled
def vehicles_figure(views: list[VehiclePeaks], profile_text: str, title: str) -> Figure:
    """One panel a vehicle, one line a model, the profile below."""
    figure = Figure(figsize=(9.2, 7.2), layout="constrained")
    panels = figure.subplots(
        len(views) + 1, 1, sharex=True, height_ratios=[1.0] * len(views) + [0.55]
    )
    for letter, axes, view in zip("abcdef", panels[:-1], views, strict=False):
        for index, (model, peak) in enumerate(view.peaks.items()):
            label = f"{MODEL_TITLES[model]} (largest {peak.max() / MM:.3f} mm)"
            axes.plot(view.x, peak / MM, label=label, **look(index))
        axes.set_ylabel("peak dynamic\nrail deflection [mm]")
        axes.set_title(f"({letter}) {view.vehicle}, {view.cars} cars, {view.speed / KMH:.0f} km/h")
        axes.set_ylim(0.0, 1.32 * max(float(p.max()) for p in view.peaks.values()) / MM)
        axes.legend(loc="upper left", ncols=3, fontsize=8)
    panels[-1].plot(views[0].x, views[0].profile / MM, color=GREY)
    panels[-1].set(xlabel="x along the track [m]", ylabel="profile [mm],\npositive down")
    panels[-1].set_xlim(0.0, float(views[0].x[-1]))
    figure.suptitle(title, x=0.01, ha="left")
    note(
        figure,
        "Largest modulus of the rail's dynamic displacement at each x while the whole train passes "
        "(static deflection left out).\nRails as a beam on an elastic layer. " + profile_text,
    )
    return figure
