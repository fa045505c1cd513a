#!/usr/bin/env bash
# Gradescope runs this once, as root, when it builds the autograder's image: it installs what Umbra needs, builds it, and
# makes ready what every submission needs.
set -euo pipefail

source_dir=${AUTOGRADER_DIR:-/autograder}/source
export DEBIAN_FRONTEND=noninteractive
export RUSTUP_HOME=${RUSTUP_HOME:-/opt/rust/rustup} CARGO_HOME=${CARGO_HOME:-/opt/rust/cargo}
export PATH="$CARGO_HOME/bin:$PATH"

apt-get update
apt-get install -y --no-install-recommends build-essential ca-certificates curl libvulkan1 mesa-vulkan-drivers
if ! command -v cargo > /dev/null; then
    curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh -s -- -y --profile minimal --default-toolchain none
fi

cd "$source_dir/umbra"
# rust-toolchain.toml names the compiler.
cargo build --release --workspace

# Compiles the template, prepares all scenes, held-back ones too: a submission does not wait for that.
target/release/umbra grade student_template --isolation reduced --jobs 1 \
    --held-back "$(cat "$source_dir/held-back-seed.txt")" --report /tmp/umbra-first
rm -rf /tmp/umbra-first

# Students' code runs as another user, and need not read right answers, the grader, or the seed. Programs, scenes and the
# compiler stay readable: that user runs them.
chmod -R o= "$source_dir"/held-back-seed.txt expected harness reference_impl
