# Debian's packages as files, without installing them. Source this.

# debian_files FOLDER (download|source) PACKAGE...: apt-get's download or, of a source package, its files, into FOLDER;
# apt verifies them. It reads lists of its own, which this system's package manager does not see: for 64-bit Arm too,
# or for sources.
debian_files() {
  local folder=$1 command=$2 own lists
  shift 2
  own=$(mktemp -d)
  lists=$own/sources
  mkdir -p "$own"/{lists/partial,cache/archives/partial,sources} "$folder"
  cp /etc/apt/sources.list.d/*.{sources,list} /etc/apt/sources.list "$lists" 2>/dev/null || true
  local -a apt=(apt-get -qq -o APT::Sandbox::User= -o Dir::State::lists="$own/lists" -o Dir::Cache="$own/cache"
    -o Dir::Etc::SourceList=/dev/null -o Dir::Etc::SourceParts="$lists" -o Acquire::Languages=none
    -o Debug::NoLocking=1)
  if [ "$command" = source ]; then
    sed -i -E 's/^Types:.*/Types: deb-src/; s/^deb /deb-src /' "$lists"/*
    command="source --download-only"
  else
    apt+=(-o APT::Architectures::=amd64 -o APT::Architectures::=arm64)
  fi
  # shellcheck disable=SC2086
  { "${apt[@]}" update && (cd "$folder" && "${apt[@]}" $command "$@"); } >"$own/log" 2>&1 ||
    { cat "$own/log" >&2; rm -rf "$own"; return 1; }
  rm -rf "$own"
}
