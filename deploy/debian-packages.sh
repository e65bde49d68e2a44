#!/bin/sh
# Debian programs that the tests use: installed where we are root, named where we are not.
missing=""
command -v mbpoll >/dev/null 2>&1 || missing="$missing mbpoll"
command -v chromium >/dev/null 2>&1 || missing="$missing chromium"
[ -z "$missing" ] && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing; } >/dev/null 2>&1 && exit 0
    echo "debian-packages: could not install$missing; the tests that need them are skipped" >&2
    exit 0
fi
echo "debian-packages: not installed:$missing; run as root: apt-get install$missing; the tests that need them are skipped" >&2
