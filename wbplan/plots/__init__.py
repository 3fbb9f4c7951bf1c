"""A plan as pictures; they know its files and not how it was made."""

from wbplan.plots.forces import figure as force_figure
from wbplan.plots.forces import save as save_forces
from wbplan.plots.overview import figure, save

__all__ = ["figure", "force_figure", "save", "save_forces"]
