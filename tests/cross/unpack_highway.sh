#!/bin/sh
# Unpacks the sources of this Debian release's Highway into FOLDER/highway-VERSION, without installing anything.
#
#   tests/cross/unpack_highway.sh FOLDER
#
# They come from the mirror that apt on this machine uses. Does nothing if they exist already.
set -eu
mkdir -p "$1"
folder=$(cd "$1" && pwd)
if [ -n "$(find "$folder" -path '*/hwy/targets.cc')" ]; then exit 0; fi

. /etc/os-release
site=$(apt-get indextargets --format '$(SITE) $(CODENAME) $(COMPONENT)' 'Created-By: Packages' |
  awk -v name="$VERSION_CODENAME" '$2 == name && $3 == "main" { print $1; exit }')
[ -n "$site" ] || { echo "unpack_highway: apt on this machine names no mirror of $VERSION_CODENAME" >&2; exit 1; }

state=$folder/apt
mkdir -p "$state/lists/partial" "$state/archives/partial" "$state/parts"
echo "deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $site $VERSION_CODENAME main" >"$state/sources.list"
sources() {
  apt-get -q -o Dir::Etc::sourcelist="$state/sources.list" -o Dir::Etc::sourceparts="$state/parts" \
    -o Dir::State::lists="$state/lists" -o Dir::Cache::archives="$state/archives" \
    -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache= -o APT::Sandbox::User=root -o Debug::NoLocking=1 "$@"
}
sources update >"$state/log" 2>&1 || { cat "$state/log" >&2; exit 1; }
(cd "$folder" && sources source --download-only highway) >>"$state/log" 2>&1 || { cat "$state/log" >&2; exit 1; }
for archive in "$folder"/highway_*.orig.tar.*; do tar -xf "$archive" -C "$folder"; done
rm -rf "$state"
[ -n "$(find "$folder" -path '*/hwy/targets.cc')" ] || { echo "unpack_highway: the source package holds no hwy/targets.cc" >&2; exit 1; }
