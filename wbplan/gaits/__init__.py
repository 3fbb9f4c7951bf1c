"""Walking: gaits as data, their margins and speeds, stances, swings, tracks, and phases made of them."""

from wbplan.gaits.building import Manner, Walk, build
from wbplan.gaits.figures import cycle_figure
from wbplan.gaits.gait import Gait
from wbplan.gaits.ground import firm, over
from wbplan.gaits.library import crawls, gait_named, gaits_of, pentagon, pentapod, quadrangular, tripod, wave
from wbplan.gaits.manipulation import SHIFT, WithBody, beside_way, nominal, shifts
from wbplan.gaits.margins import best_margin, cycle_margins, possible, regular_stance, require, step_margins
from wbplan.gaits.reach import comfortable, room, roomiest, shares
from wbplan.gaits.schedule import Beat, Course, Schedule, Step, beats_of, course_of, flat, schedule
from wbplan.gaits.stance import ANT, CRAB, MIXED_I, MIXED_II, MODES, Mode, Stance, Walker, mode_named
from wbplan.gaits.swing import CosineSwing, Excerpt, QuinticSwing
from wbplan.gaits.switch import Switch, Unfolding, perform
from wbplan.gaits.tracks import Track, arc, on_the_spot, straight, through
from wbplan.gaits.walking import CLOSING, gait_for, gaits_for, walk, walker_for

__all__ = [
    "ANT",
    "CLOSING",
    "CRAB",
    "MIXED_I",
    "MIXED_II",
    "MODES",
    "SHIFT",
    "Beat",
    "CosineSwing",
    "Course",
    "Excerpt",
    "Gait",
    "Manner",
    "Mode",
    "QuinticSwing",
    "Schedule",
    "Stance",
    "Step",
    "Switch",
    "Track",
    "Unfolding",
    "Walk",
    "Walker",
    "WithBody",
    "arc",
    "beats_of",
    "beside_way",
    "best_margin",
    "build",
    "comfortable",
    "course_of",
    "crawls",
    "cycle_figure",
    "cycle_margins",
    "firm",
    "flat",
    "gait_for",
    "gait_named",
    "gaits_for",
    "gaits_of",
    "mode_named",
    "nominal",
    "on_the_spot",
    "over",
    "pentagon",
    "pentapod",
    "perform",
    "possible",
    "quadrangular",
    "regular_stance",
    "require",
    "room",
    "roomiest",
    "schedule",
    "shares",
    "shifts",
    "step_margins",
    "straight",
    "through",
    "tripod",
    "walk",
    "walker_for",
    "wave",
]
