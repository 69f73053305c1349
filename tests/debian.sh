#!/bin/sh
# README's first two commands on a machine that has next to nothing: a new Debian (sid: the newest
# Python) without X libraries. By hand, as root, with debootstrap:
#
#   tests/debian.sh FOLDER [ARGUMENTS OF PYTEST ...]
#
# FOLDER gets the system (1 GB in the end) and keeps it for the next call.
set -eu
[ $# -ge 1 ] || { sed -n '2,7s/^# \{0,1\}//p' "$0"; exit 1; }
here=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "$1"
root=$(cd "$1" && pwd)
shift
[ -x "$root/usr/bin/python3" ] ||
  debootstrap --variant=minbase --include=python3,python3-venv,ca-certificates sid "$root"
cp /etc/resolv.conf "$root/etc/"
# Where a proxy signs, this machine knows its certificate.
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
rm -rf "$root/work"
mkdir "$root/work"
ignored=$(mktemp)
trap 'rm -f "$ignored"' EXIT
sed 's|^/|./|; s|/$||' "$here/.gitignore" > "$ignored"
tar -C "$here" --create --exclude-from="$ignored" . | tar -C "$root/work" --extract
export root commands="$(bash "$here/.ci/run" commands)" PYTEST_ADDOPTS="$*"
unset PYTHONPATH VIRTUAL_ENV KARAMELO_PY_CACHE
# Mounts end with the shell that made them. HOME is that of the new machine.
unshare --mount sh -ec '
  mount -t proc proc "$root/proc"
  mount --rbind /dev "$root/dev"
  HOME=/root exec chroot "$root" bash -ec "cd /work
python3 --version
$commands"'
