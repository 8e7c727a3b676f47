"""Settings of jobs as data: fields with their help, units and choices, read from files and written to reports."""

from .fields import SettingField as SettingField
from .fields import fields_of as fields_of
from .files import plain_settings as plain_settings
from .files import read_settings as read_settings
from .files import settings_from as settings_from
from .kinds import Kind as Kind
from .presets import preset_settings as preset_settings
from .presets import presets_of as presets_of
from .setting import setting as setting
