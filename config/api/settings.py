"""The settings of Django REST framework and drf-spectacular that no operator changes."""

REST_DEFAULTS: dict[str, object] = {
    "DEFAULT_AUTHENTICATION_CLASSES": [
        "config.api.auth.TokenAuthentication",
        "rest_framework.authentication.SessionAuthentication",
    ],
    "DEFAULT_PERMISSION_CLASSES": ["rest_framework.permissions.IsAuthenticatedOrReadOnly"],
    "DEFAULT_PARSER_CLASSES": ["rest_framework.parsers.JSONParser"],
    "DEFAULT_RENDERER_CLASSES": ["rest_framework.renderers.JSONRenderer"],
    "DEFAULT_SCHEMA_CLASS": "config.api.schema.Schema",
    "DEFAULT_VERSIONING_CLASS": None,
    "DEFAULT_THROTTLE_CLASSES": ["core.api.throttles.WriteThrottle"],
    "DEFAULT_THROTTLE_RATES": {
        "upload": "60/hour",
        "refused_upload": "240/hour",
        "write": "600/hour",
        "timing": "7200/hour",  # a timekeeper's page sends every lap
    },
    "EXCEPTION_HANDLER": "core.api.errors.handle",
    "TEST_REQUEST_DEFAULT_FORMAT": "json",
}

SPECTACULAR_SETTINGS: dict[str, object] = {
    "TITLE": "Paddock",
    "DESCRIPTION": "Upload models, enter races, read boards and results.",
    "VERSION": "1",
    "SERVE_INCLUDE_SCHEMA": False,
    "SERVE_PERMISSIONS": ["rest_framework.permissions.AllowAny"],
    "SERVE_AUTHENTICATION": [],
    "SCHEMA_PATH_PREFIX": "/api/v1",
    "COMPONENT_SPLIT_REQUEST": True,
    "ENUM_NAME_OVERRIDES": {
        "KindEnum": "races.models.RaceKind",
        "SensorsEnum": "races.models.sensors.OFFERABLE",
        "StageEnum": "league.models.Stage",
        "CupStage": "league.cups.api.STAGES",
        "NoticeKind": "league.notices.kinds.choices",
        "VehicleSensor": "training.vehicles.api.SENSORS",
        "EvaluationState": "evaluation.models.State",
        "RaceState": "races.models.RaceState",
        "TrainingState": "training.models.JobState",
        "SweepState": "training.models.SweepState",
        "TrialState": "training.sweeps.selectors.STATES",
        "VideoState": "races.runs.api.videos.STATES",
    },
    "POSTPROCESSING_HOOKS": [
        "drf_spectacular.hooks.postprocess_schema_enums",
        "config.api.schema.add_errors",
    ],
}
