"""The evidence in an FMU: the vehicle file, the covariance, the meta-data with hashes, and the signature beside it."""

import csv
import hashlib
import io
import re
import shutil
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import fmpy
import numpy as np
import pytest
import tomlkit
from lxml import etree

import rov_fmu
from rov_fmu.build import build_fmu
from rov_fmu.cli import main
from rov_fmu.fmu.archive import FOLDER, MANIFEST, META_DATA, archive
from rov_fmu.fmu.meta_data import meta_data
from rov_fmu.fmu.reference_results import reference_results
from rov_fmu.fmu.related import origin
from rov_fmu.io.messages import FileError, ProofError
from rov_fmu.io.output import WriteError
from rov_fmu.prove.check import check_evidence
from rov_fmu.prove.signature import check_signature
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from rov_fmu.vehicle.writer import write_tuned, write_vehicle
from tests.commands import BARE, Capsys, make_key
from tests.conftest import Made, without_page
from tests.often import often, spread
from tests.prove.test_properties import flipped
from tests.vehicles import THRUST_EFFECTS

_REFIT = SHIPPED["videoray_refit"]


@pytest.fixture(scope="module")
def refit() -> Mapping[str, bytes]:
    """The files of an identified vehicle in the folder of FMI-LS-REF."""
    return reference_results(load_vehicle(_REFIT))


# ---- The files and their roles ---------------------------------------------------------------------------------------


def test_a_vehicle_can_be_read_from_its_fmu(tmp_path: Path) -> None:
    """Its file is that of the user with its table of thrust, or is written anew if coefficients have changed."""
    source, name = SHIPPED["bluerov2_heavy"], f"{FOLDER}/vehicle/bluerov2_heavy.toml"
    for vehicle in (load_vehicle(source), load_vehicle(source).with_(a_d_u=150.0)):
        files, related = origin(vehicle)
        assert {f"{FOLDER}/{one.source}" for one in related} == files.keys()
        for path, content in files.items():
            (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / path).write_bytes(content)
        assert load_vehicle(tmp_path / name) == vehicle
        assert (files[name] == source.read_bytes()) == (vehicle["a_d_u"] != 150.0)
    assert origin(replace(vehicle, file=None)) == ({}, []), "of a vehicle that was made in Python there is no file"


def _shipped(name: str) -> Callable[[Path], Path]:
    return lambda _: SHIPPED[name]


def _tuned(folder: Path) -> Path:
    write_tuned(_REFIT, path := folder / "tuned.toml", {"alpha_u": 1.0 / 3.0}, "Tuned to V_ss = 0.5 at 30%")
    return path


def _by_hand(folder: Path) -> Path:
    """Written by the package, with a number of many digits."""
    write_vehicle(replace(load_vehicle(_REFIT).with_(a_d_u=100.0 / 7.0)), path := folder / "by_hand.toml")
    return path


VEHICLE_FILES = {**{name: _shipped(name) for name in SHIPPED}, "tuned": _tuned, "by hand": _by_hand}


@pytest.mark.parametrize("kind", VEHICLE_FILES)
def test_both_interfaces_put_the_bytes_of_the_users_file_into_the_fmu(kind: str, tmp_path: Path) -> None:
    path = VEHICLE_FILES[kind](tmp_path)
    one, other = load_vehicle(path), rov_fmu.load(path)
    assert one == other
    assert origin(one) == origin(other)
    assert path.read_bytes() in origin(one)[0].values()
    assert origin(one.with_(m_rov=9.87654321)) == origin(other.with_(m_rov=9.87654321)) != origin(one)
    name = f"{FOLDER}/vehicle/{one.identifier}.toml"
    for changed in (one.with_(m_rov=9.87654321), replace(one, version="2"), replace(one, limits=("It leaks.",))):
        written = changed.file_content or origin(changed)[0][name]
        assert written != path.read_bytes()
        assert b"9.87654321" in written or changed["m_rov"] == one["m_rov"]
    assert origin(replace(one.with_(m_rov=9.0), coefficients=one.coefficients, basis=one.basis)) == origin(one)


def test_a_file_that_changes_while_its_vehicle_is_in_use_does_not_change_the_vehicle(tmp_path: Path) -> None:
    path = tmp_path / "rov.toml"
    path.write_bytes(BARE.read_bytes())
    vehicle = load_vehicle(path)
    path.write_text("something else", encoding="utf-8")
    assert BARE.read_bytes() in origin(vehicle)[0].values()


ROLES = """
bluerov2_heavy.toml: model application/toml The vehicle file
t200_current_16_v.csv: model text/csv Measured electric current, curve t200
thrust_effects.toml: model application/toml The vehicle file
thrust_12_v.csv: model text/csv Measured thrust, curve main
thrust_16_v.csv: model text/csv Measured thrust, curve main
thrust_16_v.csv: model text/csv Measured thrust, curve bow
videoray_refit.toml: model application/toml The vehicle file
covariance.csv: result text/csv Standard errors and covariance of the identified coefficients
"""


def test_each_file_has_its_role_and_its_description() -> None:
    vehicles = (SHIPPED["bluerov2_heavy"], THRUST_EFFECTS, _REFIT)
    found = [one for path in vehicles for one in origin(load_vehicle(path))[1]]
    told = [f"{one.source.rpartition('/')[2]}: {one.role} {one.type} {one.description}" for one in found]
    assert told == ROLES.strip().splitlines()


def test_the_covariance_is_that_of_the_vehicle_file(refit: Mapping[str, bytes]) -> None:
    estimates = tomlkit.parse(_REFIT.read_text(encoding="utf-8"))["estimates"]
    rows = {row["name"]: row for row in csv.DictReader(io.StringIO(refit[f"{FOLDER}/covariance.csv"].decode()))}
    assert rows.keys() == estimates.keys()
    for name, row in rows.items():
        for other in rows:
            pair = estimates[name].get("correlation", {}), estimates[other].get("correlation", {})
            r = 1.0 if name == other else pair[0].get(other, pair[1].get(name, 0.0))
            expected = r * estimates[name]["error"] * estimates[other]["error"]
            assert float(row[other]) == pytest.approx(expected, rel=1e-5, abs=1e-300)
    assert (rows["a_d_r"]["unit"], rows["a_d_r"]["value"]) == ("N.m.s2/rad2", "0.0985115")


def test_the_parameter_sets_are_the_most_probable_ones_at_the_end_of_an_interval(refit: Mapping[str, bytes]) -> None:
    """By the conditional mean of a normal distribution; β has the logarithmic one."""
    vehicle = load_vehicle(_REFIT)
    rows = [*csv.DictReader(io.StringIO(refit[f"{FOLDER}/covariance.csv"].decode()))]
    names = [row["name"] for row in rows]
    mean = np.array([float(row["value"]) for row in rows])
    C = np.array([[float(row[name]) for name in names] for row in rows])
    experiments = etree.fromstring(refit[f"{FOLDER}/uncertainty.exp"])
    assert len(experiments) == 2 * len(names)
    for experiment in experiments:
        name, _, end = experiment.get("name").rpartition("_")
        k, sign = names.index(name), {"low": -1.0, "high": 1.0}[end]
        shift = C[:, k] / C[k, k] * sign * 1.959964 * np.sqrt(C[k, k])
        factor = np.array([n.startswith("beta_") for n in names])
        expected = np.where(factor, mean * np.exp(shift / mean), mean + shift)
        bounds = [(vehicle.layout.coefficients[n].minimum, vehicle.layout.coefficients[n].maximum) for n in names]
        expected = np.clip(expected, *np.array(bounds).T)
        parameters = etree.fromstring(refit[f"{FOLDER}/{experiment.find('Parameters').get('source')}"])
        values = {x.get("name"): float(x[0].get("value")) for x in parameters.iter("{*}Parameter")}
        for n, other in enumerate(names):
            assert values.get(other, mean[n]) == pytest.approx(expected[n], rel=1e-4, abs=1e-4 * np.sqrt(C[n, n]))
        vehicle.with_(**values)  # raises an exception about what is not possible


# ---- The meta-data ---------------------------------------------------------------------------------------------------


def _check_meta_data(fmu: Path) -> None:
    """Assert that the meta-data have the form of the standard, and the hash of every other file."""
    common = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureCommon.xsd"
    here = Path(__file__).parent

    class Here(etree.Resolver):  # type: ignore[misc]
        def resolve(self, url: str, _: object, context: object) -> object:
            path = common if url.endswith(common.name) else here / Path(url).name
            return self.resolve_filename(str(path), context)

    parser = etree.XMLParser()
    parser.resolvers.add(Here())
    schema = etree.XMLSchema(etree.parse(str(here / "srmd.xsd"), parser))
    with zipfile.ZipFile(fmu) as zipped:
        document = etree.fromstring(zipped.read(META_DATA))
        schema.assertValid(document)
        expected = {name: hashlib.sha3_256(zipped.read(name)).hexdigest() for name in zipped.namelist()}
        of_zeros = re.sub(rf'(?<={re.escape(META_DATA)}">)\w{{64}}', "0" * 64, zipped.read(META_DATA).decode())
    expected[META_DATA] = hashlib.sha3_256(of_zeros.encode()).hexdigest()
    found = {x.get("type"): {e.get("keyword"): e.text for e in x} for x in document}
    assert found["rov-fmu.files"] == expected
    (generator,) = found["rov-fmu.generator"]
    assert document.get("generationTool") == generator
    assert "generationDateAndTime" not in document.attrib
    assert check_evidence(fmu).files == expected


def test_the_meta_data_have_the_form_of_the_standard(videoray_fmu: Path, videoray3_fmu: Path) -> None:
    for fmu in (videoray_fmu, videoray3_fmu):
        _check_meta_data(fmu)


def test_the_meta_data_of_an_identified_vehicle_have_the_hashes_of_its_logs(tmp_path: Path) -> None:
    vehicle, logs = load_vehicle(_REFIT), _REFIT.parent / "tank_tests"
    fmu = tmp_path / "refit.fmu"
    fmu.write_bytes(archive({}, partial(meta_data, vehicle, {})))
    found = check_evidence(fmu)
    assert found.inputs == {
        path.name: f"SHA3-256: {hashlib.sha3_256(path.read_bytes()).hexdigest()}"
        for path in logs.iterdir()
        if path.name != "README.md"
    }
    assert next(iter(found.generator)).startswith("rov-fmu ")


# ---- An FMU that was altered -----------------------------------------------------------------------------------------


def _write(path: Path, files: Mapping[str, bytes]) -> Path:
    path.write_bytes(archive(dict(files)))
    return path


def _read(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as zipped:
        return {name: zipped.read(name) for name in zipped.namelist()}


@pytest.fixture
def refused(capsys: Capsys) -> Callable[..., str]:
    """Return a function that proves an FMU, which must fail with one line, and returns the reason."""

    def reason(fmu: Path, *options: str, code: int = 1) -> str:
        capsys.readouterr()
        assert main(["prove", str(fmu), *options]) == code
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        return err.removeprefix(f"rov-fmu: {fmu}: ")

    return reason


@pytest.mark.parametrize(
    "part",
    [
        "modelDescription.xml",
        "binaries/",
        f"{FOLDER}/vehicle/videoray.toml",
        f"{FOLDER}/surge_70_tuned_expected.csv",
        "documentation/index.html",
        MANIFEST,
        META_DATA,
    ],
)
@pytest.mark.parametrize("version", spread(["videoray_fmu", "videoray3_fmu"], ["videoray3_fmu"]))
def test_one_altered_byte_is_named(
    part: str, version: str, tmp_path: Path, refused: Callable[..., str], request: pytest.FixtureRequest
) -> None:
    files = _read(request.getfixturevalue(version))
    name = next(name for name in files if name.startswith(part))
    place = len(files[name]) // 2
    if name == META_DATA:
        place = files[name].index(b'">', place) + 2  # in a hash, and not in the XML around it
    altered = {**files, name: flipped(files[name], place)}
    assert re.fullmatch(
        re.escape(f"'{name}' was altered after the FMU was built: ")
        + r"its SHA3-256 is [0-9a-f]{16}…, and was [0-9a-f]{16}…\n",
        refused(_write(tmp_path / "altered.fmu", altered)),
    )


@often("stride", 31, 7, 1)
def test_no_byte_of_the_meta_data_can_be_altered(stride: int, tmp_path: Path) -> None:
    """Whether it is a name, a hash, a word or a part of the XML: the line names the meta-data."""
    files = {"a": b"1", "b": b"2"}
    good = archive(files, partial(meta_data, load_vehicle(_REFIT), files))
    with zipfile.ZipFile(io.BytesIO(good)) as zipped:
        content = zipped.read(META_DATA)
    for n in range(0, len(content), stride):
        fmu = tmp_path / "altered.fmu"
        fmu.write_bytes(archive(files, lambda _, n=n: flipped(content, n)))  # type: ignore[misc]
        with pytest.raises((ProofError, FileError)) as error:
            check_evidence(fmu)
        assert META_DATA in str(error.value)[: len(str(fmu)) + len(META_DATA) + 6], (n, str(error.value))
        assert "\n" not in str(error.value)


def test_files_that_were_added_or_taken_away_are_named(
    videoray_fmu: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    fmu, files = tmp_path / "altered.fmu", _read(videoray_fmu)
    more = _write(fmu, {**files, "resources/more.txt": b""})
    assert refused(more).startswith("'resources/more.txt' was added after")
    del files[MANIFEST]
    assert refused(_write(fmu, files)).startswith(f"'{MANIFEST}' is missing")
    with zipfile.ZipFile(fmu, "a") as twice, pytest.warns(UserWarning, match="Duplicate name"):
        twice.writestr(META_DATA, b"2")
    assert refused(fmu, code=2) == f"member '{META_DATA}': is 2 times in the archive\n"
    said = refused(_write(fmu, {META_DATA: bytes(20_000_001)}), code=2)
    assert said == f"{META_DATA}: has 20,000,001 bytes; at most 20,000,000 are read\n"


def test_a_byte_changed_in_the_archive_itself_names_the_file(
    videoray_fmu: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    with zipfile.ZipFile(videoray_fmu) as zipped:
        entry = next(entry for entry in zipped.infolist() if entry.filename.startswith("binaries/"))
    fmu = tmp_path / "damaged.fmu"
    fmu.write_bytes(flipped(videoray_fmu.read_bytes(), entry.header_offset + 1000))
    assert refused(fmu).startswith(f"'{entry.filename}' was altered after the FMU was built: ")


# ---- Signatures ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def keys(made_once: Made) -> Path:
    """A folder with keys, and with files that are none or cannot be used."""

    def fill(folder: Path) -> None:
        for name, secret in {"key": "", "other": "", "secret": "a word"}.items():
            make_key(folder / name, secret)
        for name, mode in {"text": 0o600, "open": 0o644}.items():
            (folder / name).write_bytes((folder / "key").read_bytes() if name == "open" else b"no key\n")
            (folder / name).chmod(mode)

    return made_once("keys", fill)


@pytest.fixture(scope="module")
def signed_fmu(keys: Path, made_once: Made) -> Path:
    """A signed FMU in pure Python, which needs no compiler."""

    def fill(folder: Path) -> None:
        path = folder / "refit.fmu"
        with without_page():
            built = build_fmu(load_vehicle(_REFIT), path, backend="pythonfmu", sign=keys / "key")
        assert [*built.written] == [path, path.with_name("refit.fmu.sig")]

    return made_once("signed", fill) / "refit.fmu"


def test_a_signed_fmu_is_proved(signed_fmu: Path, keys: Path, capsys: Capsys) -> None:
    assert main(["prove", str(signed_fmu), "--key", str(keys / "key.pub")]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert re.search(
        r"All \d+ files are as they were built\. Signed with the key SHA256:\S{43}\.", " ".join(out.split())
    )
    _check_meta_data(signed_fmu)


def test_a_signature_that_does_not_fit_fails(
    signed_fmu: Path, keys: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    fmu, signature = (Path(shutil.copy(path, tmp_path)) for path in (signed_fmu, f"{signed_fmu}.sig"))
    assert "is signed by another key, SHA256:" in refused(fmu, "--key", str(keys / "other.pub"))
    fmu.write_bytes(archive({}, partial(meta_data, load_vehicle(_REFIT), {})))
    assert refused(fmu).startswith(f"the signature {signature} does not fit: the FMU was altered or built again after")
    signature.unlink()
    assert refused(fmu, "--key", str(keys / "key.pub")) == f"is not signed: there is no file {signature}\n"
    signature.symlink_to("gone")
    for more in ([], ["--key", str(keys / "key.pub")]):
        assert refused(fmu, *more, code=2) == f"rov-fmu: {signature}: is a link to a file that is not there\n"


def test_no_letter_of_a_signature_can_be_altered(signed_fmu: Path, tmp_path: Path) -> None:
    fmu = Path(shutil.copy(signed_fmu, tmp_path))
    good = Path(f"{signed_fmu}.sig").read_bytes()
    for n in [n for n, byte in enumerate(good) if not chr(byte).isspace()][::17]:
        Path(f"{fmu}.sig").write_bytes(flipped(good, n))
        with pytest.raises((ProofError, FileError)) as error:
            check_signature(fmu)
        assert f"{fmu}.sig" in str(error.value)
        assert "\n" not in str(error.value)


def test_bad_keys_and_signatures_are_one_line(
    signed_fmu: Path, keys: Path, tmp_path: Path, capsys: Capsys, refused: Callable[..., str]
) -> None:
    for name, reason in {
        "text": "is not a private key of OpenSSH: `ssh-keygen -t ed25519 -f KEY` makes one",
        "secret": "has a passphrase; a key to sign with must have none",
        "open": "others may read it: a private key must be for its owner alone (chmod 600)",
        "none": "there is no such file",
    }.items():
        assert main(["build", str(_REFIT), "-o", str(tmp_path / "a.fmu"), "--sign", str(keys / name)]) == 2
        assert capsys.readouterr().err == f"rov-fmu: {keys / name}: {reason}\n"
    assert not [*tmp_path.iterdir()]
    for name in ("text", "none"):
        assert refused(signed_fmu, "--key", str(keys / name), code=2).startswith(f"rov-fmu: {keys / name}: ")
    fmu, good = Path(shutil.copy(signed_fmu, tmp_path)), Path(f"{signed_fmu}.sig").read_text(encoding="ascii")
    for text in ("", "none", good[:100], good.replace("U1NIU0lH", "U1NIU0lI"), good.replace("\nAAAA", "\nBBBB")[::-1]):
        Path(f"{fmu}.sig").write_text(text, encoding="ascii")
        expected = f"rov-fmu: {fmu}.sig: is not a signature for rov-fmu, in OpenSSH's format\n"
        assert refused(fmu, code=2) == expected


def test_an_fmu_without_a_signature_does_not_take_the_place_of_a_signed_one(
    signed_fmu: Path, tmp_path: Path, capsys: Capsys
) -> None:
    fmu = Path(shutil.copy(signed_fmu, tmp_path))
    signature = Path(shutil.copy(f"{signed_fmu}.sig", tmp_path))
    before = fmu.read_bytes()
    assert main(["build", str(_REFIT), "-o", str(fmu)]) == 2
    said = f"rov-fmu: {signature}: signs the FMU that this one replaces: sign again, or remove the signature\n"
    assert capsys.readouterr().err == said
    assert fmu.read_bytes() == before


def test_without_hashes_prove_says_so(videoray_fmu: Path, tmp_path: Path, capsys: Capsys) -> None:
    files = {name: content for name, content in _read(videoray_fmu).items() if name != META_DATA}
    assert main(["prove", str(_write(tmp_path / "bare.fmu", files))]) == 0
    assert "The FMU has no hashes of its files, and it is not signed" in " ".join(capsys.readouterr().out.split())


def test_without_ssh_keygen_a_line_says_what_is_missing(
    signed_fmu: Path, keys: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    expected = "rov-fmu: signatures need the program ssh-keygen, a part of OpenSSH 8.2 or later\n"
    for arguments in (
        ["prove", str(signed_fmu)],
        ["build", str(_REFIT), "-o", str(tmp_path / "a.fmu"), "--sign", str(keys / "key")],
    ):
        assert main(arguments) == 2
        assert capsys.readouterr().err == expected


def test_a_signed_fmu_is_built_again_without_force(
    signed_fmu: Path, keys: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rov_fmu.build._content", lambda *_, **__: pytest.fail("it is not refused"))
    fmu = Path(shutil.copy(signed_fmu, tmp_path))
    signature = Path(shutil.copy(f"{signed_fmu}.sig", tmp_path))
    rebuild = partial(build_fmu, load_vehicle(_REFIT), fmu, backend="pythonfmu", sign=keys / "key")
    with pytest.raises(pytest.fail.Exception):
        rebuild()
    signature.write_text("my work", encoding="ascii")
    with pytest.raises(WriteError, match="--force"):
        rebuild()
