#!/bin/sh
# The project's own environment, .venv, complete or not at all.
#
#     sh tools/environment.sh [EXTRA]     EXTRA: test or bench
#
# Installs wbplan (editable) with the versions in constraints.txt. A second call costs a moment: what was
# installed is written down in .venv/.wbplan/. An environment left half-way, moved, or of another Python
# is built anew. PYTHON=... chooses the interpreter.
set -eu
cd "$(dirname "$0")/.."

extra=${1:-}
venv=.venv
notes=$venv/.wbplan
python=$venv/bin/python

fail() { printf 'wbplan: %s\n' "$*" >&2; exit 1; }
say() { printf '%s\n' "$*"; }

case $(uname -s) in
    Linux | Darwin) ;;
    *) fail "this system is $(uname -s); placo and pin have wheels for Linux and macOS only" ;;
esac

# placo has wheels from Python 3.11 on; on 3.14 the resolver falls back to a years-old placo without a word.
suits='import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))'
if uv --version >/dev/null 2>&1; then
    have_uv=yes
    makes_venv='import sys'
else
    have_uv=
    makes_venv='import venv, ensurepip'
fi

find_python() {
    for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11}; do
        if "$candidate" -c "$suits" >/dev/null 2>&1 && "$candidate" -c "$makes_venv" >/dev/null 2>&1; then
            say "$candidate"
            return
        fi
    done
    # uv knows of interpreters outside PATH, and may be allowed to fetch one.
    if [ -n "$have_uv" ] && [ -z "${PYTHON:-}" ] && uv python find '>=3.11,<3.14' 2>/dev/null; then
        return
    fi
    return 1
}

key() { { cat pyproject.toml constraints.txt tools/environment.sh; pwd; } | cksum; }

note=$notes/${extra:-run}
if "$python" -c "$suits" >/dev/null 2>&1 && [ ! -e "$notes/unfinished" ] && [ -e "$note" ]; then
    if [ "$(cat "$note")" = "$(key)" ]; then exit 0; fi
fi

if [ -e "$venv" ] && { [ ! -d "$notes" ] || [ -e "$notes/unfinished" ] || ! "$python" -c "$suits" >/dev/null 2>&1; }; then
    say "wbplan: $venv is unfinished, or of another Python: building it anew"
    rm -rf "$venv"
fi
if [ ! -e "$venv" ]; then
    base=$(find_python) || fail "no suitable Python found (tried: ${PYTHON:-python3, python3.13, python3.12, python3.11}); \
wbplan needs Python 3.11, 3.12 or 3.13 with the venv module (Debian: apt-get install python3-venv). \
python3 here is: $(python3 --version 2>&1 || true). Choose one with: make PYTHON=/path/to/python"
    say "wbplan: making $venv with $("$base" --version 2>&1) ($base)"
    mkdir -p "$notes"
    : >"$notes/unfinished"
    if [ -n "$have_uv" ]; then
        uv venv --quiet --allow-existing --python "$base" "$venv"
    else
        "$base" -m venv "$venv" || fail "$base cannot make a venv (Debian: apt-get install python3-venv)"
    fi
fi
: >"$notes/unfinished"

install() {
    if [ -n "$have_uv" ]; then
        uv pip install --quiet --python "$python" --constraints constraints.txt "$@"
    else
        "$python" -m pip install --quiet --disable-pip-version-check --constraint constraints.txt "$@"
    fi
}

# The build backend comes first and from constraints.txt too: isolated builds would take the newest one.
say "wbplan: installing${extra:+ with the extra '$extra'} (a minute or two the first time)"
install hatchling editables
install --no-build-isolation --editable ".${extra:+[$extra]}"
key >"$note"
key >"$notes/run"
rm -f "$notes/unfinished"
