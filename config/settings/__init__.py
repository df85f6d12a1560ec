"""Settings. Everything an operator may change is an environment variable, listed in docs/operators.md.

The default is one machine without any preparation: SQLite and a Valkey server that comes with its Python package,
all state below one folder (PADDOCK_DATA).
"""

from importlib.util import find_spec
from pathlib import Path
from typing import TypedDict
from urllib.parse import unquote, urlsplit

from csp.constants import NONE, SELF
from django.core.exceptions import ImproperlyConfigured
from django.utils.translation import gettext_lazy as _

from config.api.settings import REST_DEFAULTS
from config.api.settings import SPECTACULAR_SETTINGS as SPECTACULAR_SETTINGS
from config.serving import broker
from core.logs.lines import FORMATTERS
from evaluation.sandbox.uids import configured_range

from .env import check_url, env_bool, env_choice, env_database, env_int, env_str, env_time, env_time_zone, env_url
from .people import *  # noqa: F403
from .people import ALLAUTH_TRUSTED_PROXY_COUNT
from .site import *  # noqa: F403
from .site import BASE_DIR, DATA_DIR, DEBUG


class BeatEntry(TypedDict):
    task: str
    schedule: float | dict[str, int | str]
    options: dict[str, int]


# --- database: SQLite in WAL mode that takes its write lock at BEGIN, or what DATABASE_URL names -------------------
DATABASES = {"default": env_database("DATABASE_URL", f"sqlite:///{DATA_DIR / 'paddock.sqlite3'}")}
if DATABASES["default"]["ENGINE"] == "django.db.backends.sqlite3":
    DATABASES["default"]["OPTIONS"] = {
        "timeout": 20,
        "cached_statements": 512,  # of 700 that pages have, which take 6 MB; Python keeps 128
        "transaction_mode": "IMMEDIATE",
        "init_command": (
            "PRAGMA journal_mode=WAL;PRAGMA synchronous=NORMAL;PRAGMA foreign_keys=ON;"
            "PRAGMA journal_size_limit=67108864;PRAGMA cache_size=-20000;"
        ),
    }
DEFAULT_AUTO_FIELD = "django.db.models.BigAutoField"

# --- broker and cache: the bundled Valkey on a unix socket, or what the variables name ----------------------------
VALKEY_DIR = DATA_DIR / "valkey"
VALKEY_SOCKET = broker.socket_path(VALKEY_DIR)
_REDIS = ("redis", "rediss", "unix")
_BROKERS = ("redis", "rediss", "redis+socket", "sentinel", "amqp", "amqps", "pyamqp")
EMBEDDED_BROKER = not env_str("CELERY_BROKER_URL", "")
CELERY_BROKER_URL = env_url("CELERY_BROKER_URL", broker.broker_url(VALKEY_SOCKET), _BROKERS, "redis://host:6379/0")
CACHE_URL = env_str("CACHE_URL", "") or (broker.cache_url(VALKEY_SOCKET) if EMBEDDED_BROKER else CELERY_BROKER_URL)
check_url(
    "CACHE_URL (Redis or Valkey, also where CELERY_BROKER_URL is neither)", CACHE_URL, _REDIS, "redis://host:6379/1"
)
CACHES = {
    "default": {
        "BACKEND": "config.serving.cache.SteadyCache",
        "LOCATION": CACHE_URL,
        "OPTIONS": {"socket_connect_timeout": 1.0, "socket_timeout": 1.0},  # no page waits longer for it
    }
}

# How far the parts that all readers share may be behind the last commit (core.streams.shared_pieces)
SHARED_PAGE_SECONDS = env_int("PADDOCK_SHARED_PAGE_SECONDS", 1)

# --- streams of events for open pages (config.serving.streams) -----------------------------------------------------
STREAM_SOCKET = broker.socket_path(DATA_DIR / "streams", "streams.sock")  # where the web server hands them over
STREAM_BELL_URL = CACHE_URL
STREAMS = env_int("PADDOCK_STREAMS", 2000, minimum=1)
STREAMS_PER_ADDRESS = env_int("PADDOCK_STREAMS_PER_ADDRESS", 1000, minimum=1)
STREAMS_PER_RACER = env_int("PADDOCK_STREAMS_PER_RACER", 20, minimum=1)

CELERY_TASK_IGNORE_RESULT = True
CELERY_TASK_ACKS_LATE = True
CELERY_WORKER_PREFETCH_MULTIPLIER = 1
CELERY_WORKER_CANCEL_LONG_RUNNING_TASKS_ON_CONNECTION_LOSS = True
CELERY_WORKER_SEND_TASK_EVENTS = False
CELERY_TASK_SERIALIZER = "json"
CELERY_ACCEPT_CONTENT = ["json"]
CELERY_BROKER_CONNECTION_RETRY_ON_STARTUP = True
CELERY_BROKER_CONNECTION_MAX_RETRIES = None  # an outage may last
if not CELERY_BROKER_URL.startswith(("amqp", "pyamqp")):
    CELERY_BROKER_TRANSPORT_OPTIONS = broker.PATIENCE
CELERY_BEAT_SCHEDULER = "evaluation.running.heartbeat:BeatingScheduler"
CELERY_TIMEZONE = "UTC"
# what waits for servers of others has a worker of its own, so that no car waits for them
CELERY_TASK_ROUTES = {f"league.tasks.{name}": {"queue": "messages"} for name in ("notices", "webhooks", "deliver")}
CELERY_TASK_ROUTES["core.events.tasks.*"] = {"queue": "messages"}
CELERY_TASK_ROUTES["courses.tasks.lti_scores"] = {"queue": "messages"}
# a show waits for no run and no video
CELERY_TASK_ROUTES["races.tasks.live"] = {"queue": "messages"}
# a busy worker delays no other kind. The messenger sweeps: an idle trainer or video-worker has no process for it
for _room, _task in (("training", "train"), ("videos", "draw")):
    CELERY_TASK_ROUTES |= {
        f"{_room}.tasks.{_task}": {"queue": _room},
        f"{_room}.tasks.sweep": {"queue": "messages"},
    }
# a dict as schedule: the arguments of crontab (config.celery)
CELERY_BEAT_SCHEDULE: dict[str, BeatEntry] = {
    "sweep": {"task": "evaluation.tasks.sweep", "schedule": 15.0, "options": {"expires": 14}},
    "reports": {"task": "evaluation.tasks.sweep_reports", "schedule": 15.0, "options": {"expires": 14}},
    "purge": {"task": "evaluation.tasks.purge", "schedule": 6 * 3600.0, "options": {"expires": 3600}},
    # a turn of 10 s each: 50 minutes of a night at most, none once everything was checked
    "scrub": {
        "task": "evaluation.tasks.scrub",
        "schedule": {"minute": "*", "hour": "1-5"},
        "options": {"expires": 50},
    },
    "duels": {"task": "races.tasks.duels", "schedule": 30.0, "options": {"expires": 29}},
    "live": {"task": "races.tasks.live", "schedule": 1.0, "options": {"expires": 2}},
    "service days": {"task": "races.tasks.service_days", "schedule": 300.0, "options": {"expires": 299}},
    "day ranks": {"task": "races.tasks.day_ranks", "schedule": 600.0, "options": {"expires": 599}},
    "redrives": {"task": "races.tasks.redrives", "schedule": 30.0, "options": {"expires": 29}},
    "rechecks": {"task": "races.tasks.rechecks", "schedule": 60.0, "options": {"expires": 59}},
    "references": {"task": "tracks.tasks.references", "schedule": 600.0, "options": {"expires": 599}},
    "rounds": {"task": "league.tasks.close_rounds", "schedule": 60.0, "options": {"expires": 59}},
    "old_trainings": {"task": "training.tasks.purge", "schedule": 6 * 3600.0, "options": {"expires": 3600}},
    "old_videos": {"task": "videos.tasks.purge", "schedule": 6 * 3600.0, "options": {"expires": 3600}},
    "clock": {"task": "league.tasks.clock", "schedule": 60.0, "options": {"expires": 59}},
    "deadlines": {"task": "courses.tasks.deadlines", "schedule": 10.0, "options": {"expires": 9}},
    "cups": {"task": "league.tasks.cups", "schedule": 20.0, "options": {"expires": 19}},
    "notices": {"task": "league.tasks.notices", "schedule": 60.0, "options": {"expires": 59}},
    "webhooks": {"task": "league.tasks.webhooks", "schedule": 60.0, "options": {"expires": 59}},
    "events": {"task": "core.events.tasks.sweep", "schedule": 60.0, "options": {"expires": 59}},
    "old_events": {"task": "core.events.tasks.trim", "schedule": 6 * 3600.0, "options": {"expires": 3600}},
    "old_sessions": {"task": "config.tasks.old_sessions", "schedule": 3600.0, "options": {"expires": 3600}},
    "retention": {
        "task": "config.tasks.retention",
        "schedule": {"minute": 30, "hour": 3},
        "options": {"expires": 3600},
    },
    "pages": {"task": "config.tasks.pages", "schedule": {"minute": 30, "hour": 0}, "options": {"expires": 3600}},
    "house cars": {"task": "league.tasks.house_cars", "schedule": 600.0, "options": {"expires": 600}},
}
CELERY_BEAT_SCHEDULE_FILENAME = str(DATA_DIR / "celerybeat-schedule")

# what happened is read within minutes; how long it can be looked up afterwards
EVENTS_KEPT_DAYS = env_int("PADDOCK_EVENTS_KEPT_DAYS", 30, minimum=4)

# how long data of racers are kept, in days; 0: for ever (core.personal_data.retention)
NOTICES_KEPT_DAYS = env_int("PADDOCK_NOTICES_KEPT_DAYS", 180, minimum=0)
WEBHOOK_DELIVERIES_KEPT_DAYS = env_int("PADDOCK_WEBHOOK_DELIVERIES_KEPT_DAYS", 30, minimum=0)
MAIL_INVITATIONS_KEPT_DAYS = env_int("PADDOCK_MAIL_INVITATIONS_KEPT_DAYS", 0, minimum=0)
TEST_RUNS_KEPT_DAYS = env_int("PADDOCK_TEST_RUNS_KEPT_DAYS", 0, minimum=0)
TRAINING_TRACES_KEPT_DAYS = env_int("PADDOCK_TRAINING_TRACES_KEPT_DAYS", 30, minimum=1)
UNCONFIRMED_ACCOUNTS_KEPT_DAYS = env_int("PADDOCK_UNCONFIRMED_ACCOUNTS_KEPT_DAYS", 0, minimum=0)
KNOWN_ADDRESSES_KEPT_DAYS = env_int("PADDOCK_KNOWN_ADDRESSES_KEPT_DAYS", 0, minimum=0)
PAST_ALIASES_KEPT_DAYS = env_int("PADDOCK_PAST_ALIASES_KEPT_DAYS", 0, minimum=0)
ADMIN_LOG_KEPT_DAYS = env_int("PADDOCK_ADMIN_LOG_KEPT_DAYS", 0, minimum=0)

# --- evaluation ----------------------------------------------------------------------------------------------------
WORKER_CONCURRENCY = env_int("PADDOCK_WORKER_CONCURRENCY", 1, minimum=1)
# "allow": workers whose golden runs differ work all the same, where all machines are of one other kind
INEXACT_WORKERS = env_choice("PADDOCK_INEXACT_WORKERS", "refuse", ("refuse", "allow"))
# the sandbox reads these two itself, in processes without settings; what is wrong shall not wait for the first model
if env_str("PADDOCK_SANDBOX_LEVEL", ""):
    env_choice("PADDOCK_SANDBOX_LEVEL", "2", ("2", "3"))
try:
    configured_range()
except ValueError as problem:
    raise ImproperlyConfigured(f"{problem}.") from None
QUEUE_ALARM_MINUTES = env_int("PADDOCK_QUEUE_ALARM_MINUTES", 30, minimum=1)
LOW_DISK_MB = env_int("PADDOCK_LOW_DISK_MB", 1024)
# official results that are driven again each day, from which hour on (UTC)
RECHECK_SAMPLE = env_int("PADDOCK_RECHECK_SAMPLE", 5, minimum=0, maximum=1000)
RECHECK_HOUR = env_int("PADDOCK_RECHECK_HOUR", 2, minimum=0, maximum=23)
LEASE_SECONDS = env_int("PADDOCK_LEASE_SECONDS", 30, minimum=5)
EVALUATION_WALL_SECONDS = env_int("PADDOCK_EVALUATION_WALL_SECONDS", 300, minimum=10)
EVALUATION_MAX_ATTEMPTS = env_int("PADDOCK_EVALUATION_MAX_ATTEMPTS", 5, minimum=1)
# what an upload may weigh, and what its network may cost; the defaults take every network of the console
UPLOAD_LIMIT_MB = env_int("PADDOCK_UPLOAD_LIMIT_MB", 512, minimum=1)
NETWORK_LIMIT_MB = env_int("PADDOCK_NETWORK_LIMIT_MB", 256, minimum=1, maximum=1000)
UNPACKED_LIMIT_MB = env_int("PADDOCK_UNPACKED_LIMIT_MB", 2048, minimum=1)
ARCHIVE_FILES = env_int("PADDOCK_ARCHIVE_FILES", 10000, minimum=2, maximum=65534)
NETWORK_LAYER_MILLIONS = env_int("PADDOCK_NETWORK_LAYER_MILLIONS", 64, minimum=1)
NETWORK_MULTIPLICATIONS_MILLIONS = env_int("PADDOCK_NETWORK_MULTIPLICATIONS_MILLIONS", 600, minimum=1)
NETWORK_VALUES_MILLIONS = env_int("PADDOCK_NETWORK_VALUES_MILLIONS", 8, minimum=1)
NETWORK_OPERATORS = env_int("PADDOCK_NETWORK_OPERATORS", 512, minimum=1, maximum=4096)
UPLOADS_AT_ONCE = env_int("PADDOCK_UPLOADS_AT_ONCE", 2, minimum=1)
UPLOAD_WAIT_SECONDS = env_int("PADDOCK_UPLOAD_WAIT_SECONDS", 20, minimum=0)
# the sandbox reads these itself
CONVERTER_MEMORY_MB = env_int("PADDOCK_CONVERTER_MEMORY_MB", 2048, minimum=512)
CONVERTER_SECONDS = env_int("PADDOCK_CONVERTER_SECONDS", 30, minimum=5)
POLICY_MEMORY_MB = env_int("PADDOCK_POLICY_MEMORY_MB", 2560, minimum=512)
POLICY_SECONDS = env_int("PADDOCK_POLICY_SECONDS", 120, minimum=10)
MODELS_PER_RACER = env_int("PADDOCK_MODELS_PER_RACER", 100, minimum=1)
STORAGE_PER_RACER_MB = env_int("PADDOCK_STORAGE_PER_RACER_MB", 10240, minimum=1)
ASSIGNMENTS_PER_TEACHER = env_int("PADDOCK_ASSIGNMENTS_PER_TEACHER", 100, minimum=1)
RACES_PER_RACER = env_int("PADDOCK_RACES_PER_RACER", 20, minimum=1)
# For how long an alias waits for its former owner after a change, and for nobody after the account was deleted
ALIAS_RESERVED_DAYS = env_int("PADDOCK_ALIAS_RESERVED_DAYS", 90, minimum=0)
ALIAS_CHANGE_DAYS = env_int("PADDOCK_ALIAS_CHANGE_DAYS", 30, minimum=0)
DATA_DOWNLOADS_A_DAY = env_int("PADDOCK_DATA_DOWNLOADS_A_DAY", 4, minimum=1)
FOLLOWED_PER_RACER = env_int("PADDOCK_FOLLOWED_PER_RACER", 200, minimum=0)
LEARNERS_PER_TEACHER = env_int("PADDOCK_LEARNERS_PER_TEACHER", 120, minimum=0)
INVITATIONS_A_DAY = env_int("PADDOCK_INVITATIONS_A_DAY", 100, minimum=0)
OWN_RUNS_AT_ONCE = env_int("PADDOCK_OWN_RUNS_AT_ONCE", 10, minimum=0)
OWN_RUNS_A_DAY = env_int("PADDOCK_OWN_RUNS_A_DAY", 300, minimum=0)
REPORTS_AT_ONCE = env_int("PADDOCK_REPORTS_AT_ONCE", 2, minimum=0)
REPORTS_A_DAY = env_int("PADDOCK_REPORTS_A_DAY", 20, minimum=0)
REPORTS_PER_RACER = env_int("PADDOCK_REPORTS_PER_RACER", 100, minimum=0)
DUELS_IN_ROUND_ROBIN = env_int("PADDOCK_DUELS_IN_ROUND_ROBIN", 16, minimum=2, maximum=32)
DUELS_IN_BRACKET = env_int("PADDOCK_DUELS_IN_BRACKET", 64, minimum=2, maximum=127)
CUP_TIME = env_time("PADDOCK_CUP_TIME", "20:00")
WEBHOOKS_PRIVATE = env_bool("PADDOCK_WEBHOOKS_PRIVATE", False)
TRACKS_PER_RACER = env_int("PADDOCK_TRACKS_PER_RACER", 20, minimum=1)

# --- training: it needs the extra packages of "make training" on the machines that train ------------------------------
TRAINING = env_bool(
    "PADDOCK_TRAINING",
    all(find_spec(name) for name in ("torch", "stable_baselines3")),
)
if TRAINING:  # without trainers the sweeps would pile up in their queue
    CELERY_BEAT_SCHEDULE["trainings"] = {"task": "training.tasks.sweep", "schedule": 15.0, "options": {"expires": 14}}
TRAINING_PAUSED = env_bool("PADDOCK_TRAINING_PAUSED", False)
TRAINING_CONCURRENCY = env_int("PADDOCK_TRAINING_CONCURRENCY", 1, minimum=1)
TRAININGS_AT_ONCE = env_int("PADDOCK_TRAININGS_AT_ONCE", 4, minimum=1)
TRAINING_MINUTES_A_MONTH = env_int("PADDOCK_TRAINING_MINUTES_A_MONTH", 1440, minimum=0)

# --- courses on a learning platform by LTI: its pages and its tasks are there only where it is set --------------------
LTI = env_bool("PADDOCK_LTI", False)
LTI_KEY_FILE = Path(env_str("PADDOCK_LTI_KEY_FILE", "") or DATA_DIR / "lti-key.pem")
LTI_PRIVATE = env_bool("PADDOCK_LTI_PRIVATE", False)

# --- videos of runs ------------------------------------------------------------------------------------------------
VIDEOS = env_bool(
    "PADDOCK_VIDEOS",
    find_spec("av") is not None,
)
if VIDEOS:
    CELERY_BEAT_SCHEDULE["videos"] = {"task": "videos.tasks.sweep", "schedule": 15.0, "options": {"expires": 14}}
if LTI:
    CELERY_BEAT_SCHEDULE["lti scores"] = {
        "task": "courses.tasks.lti_scores",
        "schedule": 30.0,
        "options": {"expires": 29},
    }
for _entry in CELERY_BEAT_SCHEDULE.values():
    _entry["options"]["expiration"] = _entry["options"]["expires"]  # RabbitMQ drops what nobody reads
VIDEO_SECONDS = env_int("PADDOCK_VIDEO_SECONDS", 600, minimum=1, maximum=600)
VIDEOS_AT_ONCE = env_int("PADDOCK_VIDEOS_AT_ONCE", 3, minimum=1)
VIDEOS_A_DAY = env_int("PADDOCK_VIDEOS_A_DAY", 20, minimum=0)
VIDEO_DAYS = env_int("PADDOCK_VIDEO_DAYS", 30, minimum=1)

# --- files ---------------------------------------------------------------------------------------------------------
STORAGE = env_str("STORAGE", "local")
if STORAGE == "local":
    _default_storage = {
        "BACKEND": "core.files.atomic_storage.WholeFileStorage",
        "OPTIONS": {
            "location": DATA_DIR / "files",
            "file_permissions_mode": 0o600,
            "directory_permissions_mode": 0o700,
        },
    }
elif STORAGE.startswith("s3://") and STORAGE.removeprefix("s3://"):
    from botocore.config import Config  # not loaded where files are in a folder

    _default_storage = {
        "BACKEND": "storages.backends.s3.S3Storage",
        "OPTIONS": {
            "bucket_name": STORAGE.removeprefix("s3://"),
            "default_acl": "private",
            "querystring_auth": True,
            "client_config": Config(
                connect_timeout=5, read_timeout=10, retries={"mode": "standard", "total_max_attempts": 2}
            ),
        },
    }
else:
    raise ImproperlyConfigured(f"STORAGE must be 'local' or 's3://BUCKET', not {STORAGE!r}.")
STORAGES = {
    "default": _default_storage,
    "staticfiles": {"BACKEND": "config.serving.static_files.StaticFiles"},
}
STATIC_URL = "static/"
STATIC_PREPARED = env_str("PADDOCK_STATIC", "")  # collected before, as in a container image
STATIC_ROOT = Path(STATIC_PREPARED or DATA_DIR / "static")
STATICFILES_DIRS = [BASE_DIR / "static"]
FILE_UPLOAD_TEMP_DIR = DATA_DIR / "uploads"
FILE_UPLOAD_TEMP_DIR.mkdir(mode=0o700, exist_ok=True)
DATA_UPLOAD_MAX_MEMORY_SIZE = 2 * 1024 * 1024

# --- languages and time --------------------------------------------------------------------------------------------
LANGUAGE_CODE = "en"
LANGUAGES = [("en", _("English")), ("ko", _("Korean"))]
FORMAT_MODULE_PATH = ["config.formats"]
LOCALE_PATHS = [BASE_DIR / "locale"]
TIME_ZONE = env_time_zone("PADDOCK_TIME_ZONE", "UTC")
USE_TZ = True

# --- what a page may load: only our own files -------------------------------------------------------------------------
CONTENT_SECURITY_POLICY = {
    "DIRECTIVES": {
        "default-src": [NONE],
        "script-src": [SELF],
        "style-src": [SELF],
        "img-src": [SELF, "data:"],
        "connect-src": [SELF],
        "font-src": [SELF],
        "media-src": [SELF],
        "manifest-src": [SELF],
        "form-action": [SELF],
        "base-uri": [NONE],
        "frame-ancestors": [NONE],
    }
}

# --- API -----------------------------------------------------------------------------------------------------------
CORS = env_bool("PADDOCK_CORS", True)
CORS_ALLOW_ALL_ORIGINS = True
CORS_ALLOW_METHODS = ("GET", "HEAD")
CORS_ALLOW_HEADERS = ("Accept", "Accept-Language", "Authorization", "If-None-Match")
CORS_EXPOSE_HEADERS = (
    *("Content-Disposition", "ETag"),
    *("RateLimit-Limit", "RateLimit-Remaining", "RateLimit-Reset", "Retry-After"),
)
REST_FRAMEWORK = {**REST_DEFAULTS, "NUM_PROXIES": ALLAUTH_TRUSTED_PROXY_COUNT}
KNOX_TOKEN_MODEL = "knox.AuthToken"
TOKEN_DAYS = env_int("PADDOCK_TOKEN_DAYS", 90, minimum=1, maximum=366)
REST_KNOX = {"TOKEN_TTL": None, "AUTO_REFRESH": False}

LOG_FORMAT = env_choice("PADDOCK_LOG_FORMAT", "plain", ("plain", "json"))
LOG_LEVELS = ("DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL")
LOGGING = {
    "version": 1,
    "disable_existing_loggers": False,
    "formatters": {"line": {"()": FORMATTERS[LOG_FORMAT]}},
    "filters": {
        "refusals": {"()": "core.logs.filters.WithoutRefusalTraces"},
        "outages": {"()": "core.logs.filters.Outages"},
    },
    "handlers": {
        "console": {"class": "logging.StreamHandler", "formatter": "line", "filters": ["refusals", "outages"]},
    },
    "root": {"handlers": ["console"], "level": env_choice("PADDOCK_LOG_LEVEL", "INFO", LOG_LEVELS)},
    "loggers": {"celery": {"level": "WARNING"}, "kombu": {"level": "WARNING"}, "botocore": {"level": "WARNING"}},
}
