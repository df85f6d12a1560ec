"""OpenLDAP's slapd for tests: a throwaway directory on a port, with TLS by a certificate authority of its own."""

from __future__ import annotations

import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from importlib.util import find_spec
from ipaddress import ip_address
from pathlib import Path

from tests.servers import running

SUFFIX = "dc=example,dc=org"
READER, READER_PASSWORD = f"cn=reader,{SUFFIX}", "the reader's password"
PASSWORD = "the directory's own password"
SCHEMAS = "/etc/ldap/schema"
MODULES = "/usr/lib/ldap"
CONFIGURATION = """
{schemas}
modulepath {modules}
moduleload back_mdb
pidfile {folder}/pid
TLSCACertificateFile {folder}/ca.pem
TLSCertificateFile {folder}/server.pem
TLSCertificateKeyFile {folder}/server.key
database mdb
maxsize 16777216
suffix "{suffix}"
rootdn "{reader}"
rootpw "{password}"
directory {folder}/data
access to attrs=userPassword by anonymous auth by * none
access to * by users read by * none
"""
ENTRIES = """
dn: {suffix}
objectClass: dcObject
objectClass: organization
o: Example

dn: ou=people,{suffix}
objectClass: organizationalUnit

dn: ou=groups,{suffix}
objectClass: organizationalUnit

dn: uid=lena,ou=people,{suffix}
objectClass: inetOrgPerson
cn: Lena
sn: Lane
mail: lena@example.org
userPassword: {password}

dn: uid=old*boss,ou=people,{suffix}
objectClass: inetOrgPerson
cn: Old Boss
sn: Boss
mail: boss@example.org
userPassword: {password}

dn: cn=paddock-admins,ou=groups,{suffix}
objectClass: groupOfNames
member: uid=lena,ou=people,{suffix}
member: uid=old*boss,ou=people,{suffix}
"""


def program() -> str | None:
    """Where slapd lies: Debian's folder is not on everybody's path."""
    return shutil.which("slapd") or next((path for path in ("/usr/sbin/slapd",) if Path(path).exists()), None)


def missing() -> str:
    """What is missing for these tests, in words; empty: nothing."""
    if program() is None:
        return "slapd is not installed (Debian: slapd)"
    if not all(find_spec(name) for name in ("ldap", "django_auth_ldap")):
        return "python-ldap is not installed (make ldap; Debian: libldap2-dev, libsasl2-dev)"
    return ""


@contextmanager
def directory(folder: Path, port: int) -> Iterator[Path]:
    """A server on a port of this machine, with ``ENTRIES``; yields the certificate of its authority."""
    (folder / "data").mkdir()
    _certificates(folder)
    schemas = [f"include {SCHEMAS}/{name}.schema" for name in ("core", "cosine", "inetorgperson", "nis")]
    words = {"folder": folder, "suffix": SUFFIX, "modules": MODULES, "schemas": "\n".join(schemas), "reader": READER}
    (folder / "slapd.conf").write_text(CONFIGURATION.format(**words, password=READER_PASSWORD))
    (folder / "entries").write_text(ENTRIES.format(suffix=SUFFIX, password=PASSWORD))
    # a copy: where AppArmor guards Debian's, that one reads no folder of tests
    slapd = shutil.copy(str(program()), folder / "slapd")
    add = [slapd, "-T", "add", "-f", folder / "slapd.conf", "-l", folder / "entries"]
    subprocess.run(add, check=True, capture_output=True)
    serve = [slapd, "-f", str(folder / "slapd.conf"), "-h", f"ldap://127.0.0.1:{port}", "-d", "0"]
    with running(serve, lambda: _answers(port)):
        yield folder / "ca.pem"


def change(port: int, ldif: str) -> None:
    """Change entries, as the directory's administrator."""
    command = ["ldapmodify", "-x", "-H", f"ldap://127.0.0.1:{port}", "-D", READER, "-w", READER_PASSWORD]
    subprocess.run(command, input=ldif, text=True, check=True, capture_output=True)


def _answers(port: int) -> bool:
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


def _certificates(folder: Path) -> None:
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    def write(name: str, subject: str, authority: tuple | None) -> tuple:
        key = ec.generate_private_key(ec.SECP256R1())
        named = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, subject)])
        issuer, signing = authority or (named, key)
        now = datetime.now(UTC)
        alternative = x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))])
        certificate = (
            x509.CertificateBuilder(issuer, named, key.public_key(), x509.random_serial_number())
            .not_valid_before(now - timedelta(days=1))
            .not_valid_after(now + timedelta(days=1))
            .add_extension(x509.BasicConstraints(ca=authority is None, path_length=None), critical=True)
            .add_extension(alternative, critical=False)
            .sign(signing, hashes.SHA256())
        )
        (folder / f"{name}.pem").write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        plain = serialization.NoEncryption()
        pem, pkcs8 = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
        (folder / f"{name}.key").write_bytes(key.private_bytes(pem, pkcs8, plain))
        return named, key

    write("server", "127.0.0.1", write("ca", "Authority of tests", None))
