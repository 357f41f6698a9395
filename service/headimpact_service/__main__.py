"""`headimpact`: serve, migrate, make keys, score or import files, refit the risk model, write the API's description."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

USAGE = 2
"""Exit code for input that cannot be used."""
FAILED = 1

app = typer.Typer(
    name="headimpact",
    help="Head-impact traces in; brain angles, injury criteria and concussion probabilities out. Research use only.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
keys_app = typer.Typer(help="Make, list and revoke API keys.", no_args_is_help=True)
app.add_typer(keys_app, name="keys")
models_app = typer.Typer(help="Register, list and promote risk models.", no_args_is_help=True)
app.add_typer(models_app, name="models")

DatabaseUrl = Annotated[
    str | None, typer.Option(help="SQLAlchemy URL; HEADIMPACT_DATABASE_URL or sqlite:///headimpact.db unless given.")
]
Organisation = Annotated[str, typer.Option(help="Name of the organisation.")]


class Mode(StrEnum):
    """Which data set a key sees."""

    LIVE = "live"
    TEST = "test"


@app.command()
def serve(
    host: Annotated[str | None, typer.Option(help="Address to listen on.")] = None,
    port: Annotated[int | None, typer.Option(help="Port to listen on; 0 takes a free one.")] = None,
    database_url: DatabaseUrl = None,
) -> None:
    """Migrate the database and serve the API; on an empty database make and print a first key."""
    from headimpact_service.cli import serve as command

    command.run(host=host, port=port, database_url=database_url)


@app.command()
def work(database_url: DatabaseUrl = None) -> None:
    """Run jobs and schedules without serving; as many of these as wanted, beside a service or without."""
    from headimpact_service.cli import work as command

    command.run(database_url=database_url)


@models_app.command("add")
def add_models(
    files: Annotated[list[Path], typer.Argument(help="Files model.json of `headimpact refit`.")],
    organisation: Organisation = "default",
    mode: Annotated[Mode, typer.Option(help="The data set that the models are for.")] = Mode.LIVE,
    database_url: DatabaseUrl = None,
) -> None:
    """Register models; a version never changes, and nothing is scored by it until it is promoted."""
    from headimpact_service.cli import models as command

    command.add(files, organisation=organisation, mode=mode.value, database_url=database_url)


@models_app.command("list")
def list_models(
    organisation: Organisation = "default",
    mode: Annotated[Mode, typer.Option(help="The data set that the models are for.")] = Mode.LIVE,
    database_url: DatabaseUrl = None,
) -> None:
    """List versions and what the aliases mean."""
    from headimpact_service.cli import models as command

    command.show(organisation=organisation, mode=mode.value, database_url=database_url)


@models_app.command("promote")
def promote_model(
    version: str,
    reason: Annotated[str, typer.Option(help="For whoever asks later.")],
    organisation: Organisation = "default",
    mode: Annotated[Mode, typer.Option(help="The data set that the models are for.")] = Mode.LIVE,
    database_url: DatabaseUrl = None,
) -> None:
    """Let a version score new impacts. Going back is the same with the version before."""
    from headimpact_service.cli import models as command

    command.promote(version, reason=reason, organisation=organisation, mode=mode.value, database_url=database_url)


@app.command()
def migrate(database_url: DatabaseUrl = None) -> None:
    """Bring the database to this version's schema."""
    from headimpact_service.cli import database as command

    command.migrate(database_url)


@keys_app.command("create")
def create_key(
    organisation: Organisation,
    scope: Annotated[list[str], typer.Option(help="May be repeated; `all` is every scope.")],
    mode: Annotated[Mode, typer.Option(help="A test key sees a separate sandbox data set.")] = Mode.LIVE,
    name: Annotated[str, typer.Option(help="What the key is for.")] = "key",
    database_url: DatabaseUrl = None,
) -> None:
    """Make a key; the organisation is made or reused by its name. The last line printed is the key."""
    from headimpact_service.cli import keys as command

    command.create(organisation, scope, mode=mode.value, name=name, database_url=database_url)


@keys_app.command("list")
def list_keys(organisation: Organisation = "default", database_url: DatabaseUrl = None) -> None:
    """List an organisation's keys, revoked ones too."""
    from headimpact_service.cli import keys as command

    command.show(organisation, database_url=database_url)


@keys_app.command("revoke")
def revoke_key(key_id: str, organisation: Organisation = "default", database_url: DatabaseUrl = None) -> None:
    """Make a key invalid."""
    from headimpact_service.cli import keys as command

    command.revoke(organisation, key_id, database_url=database_url)


@app.command()
def score(
    file: Annotated[
        Path,
        typer.Argument(help="A file, a laboratory's folder, or - for standard input."),
    ],
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON of POST /v1/score.")] = False,
    preset: Annotated[str | None, typer.Option(help="A device's layout, as GET /v1/presets lists them.")] = None,
    mapping: Annotated[str | None, typer.Option(help="JSON, or @ and a file of it: which column is what.")] = None,
    sample_rate_hz: Annotated[str | None, typer.Option(help="Samples per second.")] = None,
    axes: Annotated[str | None, typer.Option(help="anatomical or sae_j211.")] = None,
    low_pass: Annotated[str | None, typer.Option("--filter", help="paper, none, or JSON.")] = None,
    occurred_at: Annotated[str | None, typer.Option(help="RFC 3339, or a local time with --time-zone.")] = None,
    time_zone: Annotated[str | None, typer.Option(help="IANA zone of local times.")] = None,
) -> None:
    """Score the impacts of a file; nothing is stored and no service is needed."""
    from headimpact_service.cli import score as command

    fields = {
        "preset": preset,
        "mapping": mapping,
        "sample_rate_hz": sample_rate_hz,
        "axes": axes,
        "filter": low_pass,
        "occurred_at": occurred_at,
        "time_zone": time_zone,
    }
    given = {name: value for name, value in fields.items() if value is not None}
    raise typer.Exit(command.run(file, given, as_json=as_json))


@app.command("import")
def import_files(
    paths: Annotated[list[Path], typer.Argument(help="Files or folders; a folder of one crash test is one set.")],
    organisation: Organisation = "default",
    mode: Annotated[Mode, typer.Option(help="The data set that the impacts go into.")] = Mode.LIVE,
    preset: Annotated[str | None, typer.Option(help="A device's layout, as GET /v1/presets lists them.")] = None,
    mapping: Annotated[str | None, typer.Option(help="JSON, or @ and a file of it: which column is what.")] = None,
    athlete: Annotated[str | None, typer.Option(help="Your id of the athlete.")] = None,
    device: Annotated[str | None, typer.Option(help="Serial number of the device.")] = None,
    occurred_at: Annotated[str | None, typer.Option(help="RFC 3339, or a local time with --time-zone.")] = None,
    time_zone: Annotated[str | None, typer.Option(help="IANA zone of local times.")] = None,
    sample_rate_hz: Annotated[str | None, typer.Option(help="Samples per second.")] = None,
    axes: Annotated[str | None, typer.Option(help="anatomical or sae_j211.")] = None,
    low_pass: Annotated[str | None, typer.Option("--filter", help="paper, none, or JSON.")] = None,
    fill_gaps: Annotated[str | None, typer.Option(help="true fills gaps of at most 2 samples.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be read; store nothing.")] = False,
    database_url: DatabaseUrl = None,
) -> None:
    """Import files into the database, as POST /v1/imports does; what is there already is unchanged."""
    from headimpact_service.cli import importing as command

    fields = {
        "preset": preset,
        "mapping": mapping,
        "athlete": athlete,
        "device": device,
        "occurred_at": occurred_at,
        "time_zone": time_zone,
        "sample_rate_hz": sample_rate_hz,
        "axes": axes,
        "filter": low_pass,
        "fill_gaps": fill_gaps,
    }
    given = {name: value for name, value in fields.items() if value is not None}
    code = command.run(
        paths, given, organisation=organisation, mode=mode.value, dry_run=dry_run, database_url=database_url
    )
    raise typer.Exit(code)


class Sampling(StrEnum):
    """How the impacts of a cohort were chosen."""

    CASE_CONTROL = "case_control"
    FULL_FOLLOW_UP = "full_follow_up"


class BiasCorrection(StrEnum):
    """What is done about the bias of few events; zelig reproduces the paper."""

    KING_ZENG = "king_zeng"
    FIRTH = "firth"
    ZELIG = "zelig"
    NONE = "none"


class Include(StrEnum):
    """Impacts that enter a cohort only where they are asked for."""

    UNVERIFIED = "unverified"
    FALSE_POSITIVE = "false_positive"
    NOT_WORN = "not_worn"


@app.command()
def refit(
    table: Annotated[Path, typer.Option(help="CSV or Parquet: athlete_id, outcome, and columns of criteria.")],
    out: Annotated[Path, typer.Option(help="Folder for report.json, report.html and model.json.")],
    criterion: Annotated[
        list[str] | None, typer.Option(help="May be repeated; hic15+bric fits both together. All unless given.")
    ] = None,
    sampling: Annotated[Sampling, typer.Option(help="How the impacts were chosen.")] = Sampling.CASE_CONTROL,
    incidence: Annotated[
        float | None, typer.Option(help="Concussions per impact that a case-control sample is corrected to.")
    ] = None,
    incidence_range: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="<least> <greatest>", help="Two numbers, for the range of the intercept: 0.001 0.02."),
    ] = None,
    bias_correction: Annotated[
        BiasCorrection, typer.Option(help="Of the bias of few events.")
    ] = BiasCorrection.KING_ZENG,
    replicas: Annotated[int, typer.Option(help="Bootstrap resamples, by impact and by athlete each.")] = 1000,
    folds: Annotated[
        Path | None, typer.Option(help="Lines athlete_id,fold; five folds are drawn unless given.")
    ] = None,
    resamples: Annotated[
        Path | None, typer.Option(help="Row numbers from 0 of each resample by impact, one resample a line.")
    ] = None,
    sensitivity: Annotated[
        list[float] | None, typer.Option(help="May be repeated; thresholds are found for it. 0.5 and 0.9 unless given.")
    ] = None,
    include: Annotated[list[Include] | None, typer.Option(help="May be repeated.")] = None,
    active: Annotated[
        str | None, typer.Option(help="Compare with a published model's version, or with a model's file.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of everything that is drawn.")] = 0,
    version: Annotated[str | None, typer.Option(help="What the model is called.")] = None,
) -> None:
    """Fit a risk model to a table of criteria with outcomes; no service is needed."""
    from headimpact_service.cli import refit as command

    options = {
        "criteria": tuple(criterion or ()),
        "sampling": sampling.value,
        "incidence": incidence,
        "incidence_range": incidence_range,
        "bias_correction": bias_correction.value,
        "replicas": replicas,
        "seed": seed,
        "sensitivity_targets": None if sensitivity is None else tuple(sensitivity),
    }
    given = {name: value for name, value in options.items() if value is not None}
    wanted = frozenset(kind.value for kind in include or ())
    command.run(table, out, command.Request(given, wanted, folds, resamples, active, version))


@app.command()
def openapi(
    output: Annotated[Path, typer.Option(help="Where the OpenAPI document goes.")] = Path("openapi/openapi.json"),
    problems: Annotated[Path, typer.Option(help="Where the list of problems goes.")] = Path("docs/problems.md"),
) -> None:
    """Write the API's description and the list of problems, both made from the code."""
    from headimpact_service.cli import openapi as command

    command.write(output, problems)


def main() -> None:
    """Run a command; whatever goes wrong is one line, with exit code 2 where the input is to blame."""
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        sys.exit(_report(error))


def _report(error: Exception) -> int:
    from headimpact_service.cli.faults import explain

    text, code = explain(error)
    print(f"headimpact: {text}", file=sys.stderr)
    return code


if __name__ == "__main__":
    main()
