"""The code that each stored result depends on: its key takes in the source of these modules, packages with all below.

``tests/contract/test_declared_code.py`` holds every list against the imports of the modules in it.
"""

_SAMPLES = (
    *("schemas.errors", "schemas.tables", "schemas.units", "schemas.version"),
    *("inertial.frames", "pipelines.tables"),
)
_TABLES = (*_SAMPLES, "inertial.arrays", "inertial.errors", "inertial.quantities", "inertial.state")
_MODEL = (
    *("inertial.design", "inertial.effects", "inertial.expressions", "inertial.fits"),
    *("inertial.operators", "inertial.splines", "inertial.power"),
)
_ENGINE = (
    *(*_TABLES, *_MODEL, "inertial.counts", "inertial.data_errors", "inertial.decisions", "inertial.distributions"),
    *("inertial.estimation", "inertial.noise"),
)
_NOISE = (
    *(*_TABLES, *_MODEL, "inertial.distributions", "inertial.disturbances", "inertial.dynamics", "inertial.noise"),
    *("inertial.record_faults", "pipelines.stages.noise", "pipelines.stages.static_record"),
)
_BUDGET = (
    *(*_TABLES, *_MODEL, "schemas", "inertial.correction", "inertial.distributions", "inertial.noise"),
    *("inertial.uncertainty", "pipelines.stages.rms_error", "pipelines.stages.uncertainty"),
)
_PROCEDURES = ("schemas", "stations", "inertial", "pipelines.drawing", "pipelines.procedures", "pipelines.tables")
_READ = ("schemas", "inertial", "pipelines.archive", "pipelines.importers", "pipelines.procedures", "pipelines.tables")
_DRAWN = (
    *("schemas", "inertial", "pipelines.archive", "pipelines.certificates", "pipelines.drawing"),
    *("pipelines.procedures", "pipelines.report", "pipelines.stages", "pipelines.tables"),
)

CODE = {
    "validate": (*_SAMPLES, "inertial.pointing", "pipelines.stages.validate"),
    "reduce": (*_TABLES, "pipelines.stages.reduce"),
    "fit": (
        *(*_ENGINE, "inertial.population", "pipelines.stages.fit", "pipelines.stages.noisy_fit"),
        "pipelines.stages.uncertainty.bias_measurands",
    ),
    "fit of norms": (
        *(*_ENGINE, "inertial.correction", "inertial.norm_fit"),
        *("pipelines.stages.uncertainty.bias_measurands", "pipelines.stages.unknown_poses"),
    ),
    "fit in a plane": (
        *(*_ENGINE, "inertial.probability", "inertial.uncertainty"),
        *("pipelines.importers.judged", "pipelines.importers.plane"),
    ),
    "judge": (
        *(*_ENGINE, "inertial.criticism", "inertial.planning.drivers"),
        *("inertial.planning.sequences", "inertial.probability", "inertial.timing"),
        "pipelines.stages.judge",
    ),
    "verify": (*_ENGINE, "inertial.correction", "pipelines.stages.rms_error", "pipelines.stages.verify"),
    "verify of norms": (
        *(*_ENGINE, "inertial.correction", "inertial.norm_fit", "inertial.uncertainty"),
        *("pipelines.stages.rms_error", "pipelines.stages.unknown_poses", "pipelines.stages.verify"),
    ),
    "noise": _NOISE,
    "soak_noise": (
        *(*_NOISE, "inertial.decisions", "inertial.estimation.scatter"),
        "pipelines.stages.soak_noise",
    ),
    "budget": _BUDGET,
    "budget of norms": (
        *(*_BUDGET, "inertial.counts", "inertial.data_errors", "inertial.decisions", "inertial.estimation"),
        *("inertial.norm_fit", "pipelines.stages.unknown_poses", "pipelines.stages.verify"),
    ),
    "procedures": (*_PROCEDURES, "pipelines.stages.procedures"),
    "grade": (
        *(*_NOISE, "schemas", "inertial.counts", "inertial.probability", "inertial.uncertainty"),
        *("pipelines.procedures", "pipelines.stages.figures"),
        *("pipelines.stages.grade", "pipelines.stages.uncertainty"),
    ),
    "import": _READ,
    "import with a fit": (*_READ, "pipelines.diagnosis", "pipelines.parallel", "pipelines.stages"),
    "import of waveforms": (*_PROCEDURES, "pipelines.archive", "pipelines.importers"),
    "import of a transfer function": _READ,
    "report": (
        *(*_DRAWN, "stations", "pipelines.capture", "pipelines.importers", "pipelines.jobs"),
        *("pipelines.schedule.early_end", "pipelines.schedule.steps"),
    ),
    "report of an import": (*_DRAWN, "pipelines.diagnosis", "pipelines.jobs.model_files", "pipelines.parallel"),
    "inquiry": (
        *("schemas", "inertial", "pipelines.diagnosis", "pipelines.parallel"),
        *("pipelines.procedures", "pipelines.tables"),
    ),
}
"""Modules and packages by the name of the stage, or of what else is stored under a key."""
