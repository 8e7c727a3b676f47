"""All numbers of a mesh at once, as ``torchfair measure`` and ``torchfair diagnose`` print them."""

from .._graph import count_components as count_components
from .diagnosis import Diagnosis as Diagnosis
from .diagnosis import diagnose_mesh as diagnose_mesh
from .element_measures import EdgeMeasures as EdgeMeasures
from .element_measures import PanelMeasures as PanelMeasures
from .element_measures import edge_measures as edge_measures
from .element_measures import panel_measures as panel_measures
from .element_measures import worst_edges as worst_edges
from .element_measures import worst_panels as worst_panels
from .measurements import Quantity as Quantity
from .measurements import measure_mesh as measure_mesh
from .pattern_words import pattern_words as pattern_words
from .remedies import Remedy as Remedy
from .remedies import layout_advice as layout_advice
from .remedies import star_remedies as star_remedies
from .remedies import star_remedy as star_remedy
from .stationarity import Stationarity as Stationarity
from .stationarity import measure_stationarity as measure_stationarity
from .trust import count_meetings as count_meetings
from .trust import curvature_doubts as curvature_doubts
from .trust import fold_measures as fold_measures
from .verdict import verdict as verdict
