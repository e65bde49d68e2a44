"""Signatures of manifests: Ed25519 (RFC 8032), with a key that lies outside the archive.

A manifest's signature stands in it, under ``signature``, and is over its canonical JSON without that entry.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Collection, Mapping
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schemas.errors import ArchiveUnusable, WrongUse

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

ENTRY = "signature"
VARIABLE = "TUMBLELINE_SIGNING_KEY"
GOOD, UNSIGNED, UNKNOWN, BAD = "good", "unsigned", "unknown key", "bad"


def key_file() -> Path | None:
    """The file of the private key: from the environment (none where the variable is empty), else the default file."""
    if VARIABLE in os.environ:
        named = os.environ[VARIABLE].strip()
        return Path(named) if named else None
    default = default_key_file()
    return default if default.is_file() else None


def default_key_file() -> Path:
    """The default file of the private key of the user."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "tumbleline" / "signing.key"


def signed(content: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest with a signature where a key is configured, without one otherwise."""
    path = key_file()
    plain = {name: value for name, value in content.items() if name != ENTRY}  # the writer of a copy signs it anew
    if path is None:
        return plain
    key, name = _private(str(path))
    value = base64.b64encode(key.sign(_canonical(plain))).decode()
    return {**plain, ENTRY: {"key": name, "value": value}}


def check(content: Mapping[str, Any], keys: Mapping[str, Ed25519PublicKey]) -> str:
    """State of the signature of a manifest: ``good``, ``unsigned``, ``unknown key`` or ``bad``.

    keys : public keys that are trusted, by name.
    """
    from cryptography.exceptions import InvalidSignature

    entry = content.get(ENTRY)
    if entry is None:
        return UNSIGNED
    if not isinstance(entry, dict) or not {"key", "value"} <= entry.keys():
        return BAD
    key = keys.get(str(entry["key"]))
    if key is None:
        return UNKNOWN
    try:
        key.verify(base64.b64decode(str(entry["value"]), validate=True), _canonical(content))
    except (InvalidSignature, ValueError):
        return BAD
    return GOOD


def public_keys(given: Collection[str] = ()) -> dict[str, Ed25519PublicKey]:
    """The public keys that are trusted, by name: the given keys, else that of the configured private key.

    given : files in PEM, or keys as 64 hexadecimal digits.
    """
    if given:
        keys = [_public(text) for text in given]
    else:
        path = key_file()
        keys = [_private(str(path))[0].public_key()] if path is not None else []
    return {name_of(key): key for key in keys}


def name_of(key: Ed25519PublicKey) -> str:
    """A key's name: the first 16 digits of the hash of its raw bytes."""
    return sha256(key.public_bytes_raw()).hexdigest()[:16]


def make_key(path: Path) -> Ed25519PublicKey:
    """Make a private key, write it to a file that only its owner can read, and return its public key."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    key = Ed25519PrivateKey.generate()
    pem = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(pem)
    except FileExistsError:
        raise WrongUse(
            f"archive key: {path} exists, a new file is needed; keep it, or name another with --output"
        ) from None
    except OSError as problem:
        raise WrongUse(
            f"archive key: {path} cannot be written ({problem.strerror}); name another file with --output"
        ) from None
    return key.public_key()


def private_key(path: Path) -> Ed25519PrivateKey:
    """The private key in a file."""
    return _private(str(path))[0]


def _canonical(content: Mapping[str, Any]) -> bytes:
    rest = {name: value for name, value in content.items() if name != ENTRY}
    return json.dumps(rest, sort_keys=True, ensure_ascii=False, separators=(",", ":")).encode()


@cache
def _private(path: str) -> tuple[Ed25519PrivateKey, str]:
    """The private key in a file, and its name."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        key = load_pem_private_key(Path(path).read_bytes(), None)
    except OSError as problem:
        raise ArchiveUnusable(
            f"archive: signing key {path} cannot be read ({problem.strerror}); correct {VARIABLE}, or unset it"
        ) from None
    except (ValueError, TypeError):
        key = None
    if not isinstance(key, Ed25519PrivateKey):
        raise ArchiveUnusable(
            f"archive: {path} is no signing key, an Ed25519 key in PEM without a passphrase is needed; make one with "
            "'tumbleline archive key'"
        )
    return key, name_of(key.public_key())


def _public(text: str) -> Ed25519PublicKey:
    """A public key in a file, or as hexadecimal digits."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.hazmat.primitives.serialization import load_pem_public_key

    try:
        if len(text) == 64 and not Path(text).exists():
            return Ed25519PublicKey.from_public_bytes(bytes.fromhex(text))
        key = load_pem_public_key(Path(text).read_bytes())
    except (OSError, ValueError):
        key = None
    if not isinstance(key, Ed25519PublicKey):
        raise WrongUse(
            f"verify: '{text}' is no public key, an Ed25519 key in PEM or 64 hexadecimal digits are needed; correct --trust"
        )
    return key
