"""Progress of long work on a terminal or in a log: callbacks for solvers, phases, the time that is left."""

from .display import ProgressDisplay as ProgressDisplay
from .display import Record as Record
from .frames import frame_progress as frame_progress
from .phases import listening as listening
from .phases import phase as phase
from .shown_phases import shown_phases as shown_phases
from .time_left import TimeLeft as TimeLeft
from .time_left import duration as duration
