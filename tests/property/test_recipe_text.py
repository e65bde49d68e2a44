"""A recipe that is written as a file and read again is the same recipe, whatever stands in it."""

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from inertial.poses import plan
from pipelines.jobs.recipe_text import recipe_text
from pipelines.jobs.recipes import resolved
from schemas.fault import FaultOrder
from schemas.poses import SoakPart
from schemas.prior import PriorTerms
from schemas.recipe import Recipe, RecipeFile
from schemas.stopping import StopTerms
from schemas.toml_files import parse_as
from schemas.uncertainty import Uncertainty
from schemas.validity import Ageing, CertificateTerms, Stability

EFFECTS = ("bias", "scale", "misalignment", "bias_temperature", "warm_up", "covariate:humidity_pct")
MADE_OTHERWISE = {"model"}  # a recipe with a model file is written with that model's effects
SEVEN = [[33.0 + 0.5 * k, 71.5] for k in range(7)]  # directions in none of the plans


def numbers(low, high):
    return st.floats(low, high, allow_nan=False) | st.integers(int(low), int(high)).map(float)


def maybe(strategy):
    return st.none() | strategy


TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=30)
NAMES = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=30)
SERIALS = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,8}", fullmatch=True)
FAULTS = st.builds(
    FaultOrder,
    kind=st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True),
    at_s=numbers(0.0, 1e5),
    for_s=maybe(numbers(1.0, 1e4)),
    serial=st.just("") | SERIALS,
    figures=st.dictionaries(st.from_regex(r"[a-z_]{1,6}", fullmatch=True), numbers(-10.0, 10.0), max_size=2),
)
STATED = st.builds(
    lambda u, half, source: Uncertainty.model_validate(
        {
            "grade_source": "data_sheet",
            "level": {"u_urad": u, "source": source},
            "seat": {"half_width_deg": half, "distribution": "rectangular", "scope": "mount", "source": source},
            "thermometer": {"measures": "slot", "offset_U_K": u, "k": 2.0, "soak_u_K": half, "source": source},
        }
    ),
    numbers(0.0, 1e3),
    numbers(0.0, 1.0),
    NAMES,
)
STABILITY = st.builds(
    Stability,
    switch_on_ug=numbers(0.0, 500.0),
    horizon_days=numbers(1.0, 4000.0),
    source=st.sampled_from(["history", "data_sheet"]),
    ageing=maybe(st.just(Ageing(form="log", per_decade_ug=50.0))),
)
CERTIFICATES = st.builds(
    CertificateTerms,
    validity_months=st.integers(1, 120),
    force_range_g=maybe(st.just((-2.0, 2.0))),
    frame=st.sampled_from(["fixture", "intrinsic"]),
)

PRIORS = st.builds(
    PriorTerms,
    archive=st.sampled_from(["", "../archive", "s3://lab/archive"]),
    since=maybe(st.dates()),
    full=st.sampled_from(["", "production"]),
)

PROCEDURES = st.fixed_dictionaries(
    {"kind": st.just("tilt"), "about": st.sampled_from(["x", "y"]), "dwell_s": numbers(1.0, 100.0)}
)


ASKED = {"bias": "bias_ug", "scale": "scale_ppm", "misalignment": "misalignment_urad"}


def stops(effects):
    asked = {name: maybe(numbers(1.0, 1e4)) for effect, name in ASKED.items() if effect in effects}
    visible = st.lists(st.sampled_from(["third_order", "thermal_lag"]), max_size=2, unique=True)
    return st.builds(StopTerms, visible=visible, longest_dwell_s=maybe(numbers(1.0, 100.0)), **asked)


@st.composite
def soaks(draw, poses, verification):
    own = draw(maybe(st.lists(st.integers(1, poses), min_size=1, max_size=4)))
    count = poses if own is None else len(own)
    each = st.lists(numbers(0.0, 900.0), min_size=count, max_size=count)
    return SoakPart(
        temperature_C=0.0,
        poses=own,
        verification=draw(maybe(st.lists(st.integers(1, verification), max_size=3))) if verification else None,
        waits_s=draw(maybe(each)),
        off_s=draw(maybe(each)),
        settled=draw(st.booleans()),
    )


@st.composite
def recipe_files(draw):
    name = draw(st.sampled_from(["nine", "twelve"]))
    angles = plan(name).tolist()
    poses = draw(st.sampled_from([name, angles]))
    verification = draw(st.lists(st.sampled_from(SEVEN), max_size=3))
    repeats = draw(st.integers(1, 20))
    temperatures = draw(st.lists(numbers(-40.0, 85.0), min_size=1, max_size=4, unique=True))
    checks = repeats * len(verification)
    parts = [draw(soaks(len(angles), checks)) for _ in temperatures] if draw(st.booleans()) else []
    short = draw(st.booleans())
    effects = draw(st.lists(st.sampled_from(EFFECTS), min_size=1, unique=True))
    return RecipeFile(
        name=draw(st.from_regex(r"[a-z0-9][a-z0-9._-]{0,12}", fullmatch=True)),
        description=draw(TEXTS),
        device=draw(NAMES),
        local_gravity_m_s2=draw(st.floats(9.71, 9.89)),
        temperatures_C=temperatures,
        soaks=[part.model_copy(update={"temperature_C": t}) for part, t in zip(parts, temperatures, strict=False)],
        soak_min_s=draw(numbers(1.0, 899.0) if short else numbers(900.0, 9000.0)),
        allow_short_soak=short or draw(st.booleans()),
        settle_s=draw(numbers(0.0, 100.0)),
        dwell_s=draw(numbers(10.0, 100.0)),
        rate_hz=draw(numbers(100.0, 4000.0)),
        static_record_s=draw(numbers(0.0, 5000.0)),
        static_temperature_C=draw(numbers(-40.0, 85.0)),
        sensor_axes=draw(st.integers(1, 3)),
        zero_output=draw(numbers(-5.0, 5.0)),
        span_min_g=draw(numbers(1.0, 1.4)),
        effects=effects,
        stop=draw(maybe(stops(effects))),
        limits=draw(NAMES),
        units=draw(st.lists(SERIALS, max_size=3, unique=True)),
        seed=draw(st.integers(0, 2**60)),
        faults=draw(st.lists(FAULTS, max_size=2)),
        poses=poses,
        verification=verification,
        verification_repeats=repeats,
        static_pose=[draw(numbers(-180.0, 180.0)), draw(numbers(-180.0, 180.0))],
        verification_order=draw(st.sampled_from(["last", "interleaved"])),
        uncertainty=draw(maybe(STATED)),
        stability=draw(maybe(STABILITY)),
        certificate=draw(maybe(CERTIFICATES)),
        prior=draw(maybe(PRIORS)),
        procedures=draw(st.lists(PROCEDURES, max_size=2)),
    )


def read_again(recipe: Recipe) -> Recipe:
    return resolved(parse_as(RecipeFile, recipe_text(recipe, ["a remark"]), "again"), "again")


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(recipe_files())
def test_a_recipe_written_as_a_file_reads_as_itself_whichever_key_it_has(file):
    assert file.model_fields_set >= set(RecipeFile.model_fields) - MADE_OTHERWISE
    assert all(part.model_fields_set == set(SoakPart.model_fields) for part in file.soaks)
    recipe = resolved(file, "generated")
    assert read_again(recipe) == recipe
