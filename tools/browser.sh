#!/bin/sh
# Chromium for the tests of the viewer's page: found, or installed with apt-get where that needs no password.
# Without it those tests skip, with a word; this script never fails for it.
set -u

command -v chromium >/dev/null 2>&1 && exit 0

without() { printf 'wbplan: %s: the browser tests will skip\n' "$*" >&2; exit 0; }

command -v apt-get >/dev/null 2>&1 || without "no Chromium, and no apt-get to install it with"
if [ "$(id -u)" -eq 0 ]; then
    as_root=
elif sudo -n true 2>/dev/null; then
    as_root='sudo -n'
else
    without "no Chromium, and installing it needs root (apt-get install chromium)"
fi

printf 'wbplan: installing Chromium for the browser tests\n'
log=$(mktemp)
trap 'rm -f "$log"' EXIT
{
    $as_root apt-get update -q &&
        $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends chromium
} >"$log" 2>&1 </dev/null || { tail -n 3 "$log" >&2; without "apt-get could not install chromium"; }
