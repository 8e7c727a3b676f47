"""What all formfinding jobs share: recipe, session, result."""

from .live import Progress as Progress
from .plan import OneStage as OneStage
from .plan import Plan as Plan
from .plan import Stage as Stage
from .promises import Promise as Promise
from .pulls import Pulls as Pulls
from .recipe import JobSettings as JobSettings
from .recipe import Recipe as Recipe
from .report import job_report as job_report
from .result import JobResult as JobResult
from .result import Level as Level
from .session import Session as Session
from .solve import solved as solved
