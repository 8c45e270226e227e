#!/bin/sh
# Checks glTF files with the Khronos validator (npm package gltf-validator), fetched into a throwaway folder.
# Prints one line a file; fails on any error or warning. Usage: scripts/validate-gltf.sh FILE...
set -eu
VERSION=2.0.0-dev.3.10

if [ $# -eq 0 ]; then
    echo "usage: $0 FILE.glb|FILE.gltf..." >&2
    exit 2
fi
# In CI everything must be there; elsewhere a missing tool is no fault.
skip() {
    echo "skipped: needs $1"
    [ "${CI:-}" = true ] && exit 1
    exit 0
}
command -v node >/dev/null 2>&1 || skip node
command -v npm >/dev/null 2>&1 || skip npm

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT INT TERM
npm install --silent --no-audit --no-fund --prefix "$folder" "gltf-validator@$VERSION" >&2 || skip "gltf-validator from npm"

cat >"$folder/validate.js" <<'JS'
const fs = require('fs'), path = require('path');
const validator = require('gltf-validator');

async function check(file) {
  const beside = uri => new Uint8Array(fs.readFileSync(path.join(path.dirname(file), decodeURIComponent(uri))));
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
    uri: path.basename(file),
    externalResourceFunction: async uri => beside(uri),
  });
  const { numErrors, numWarnings, numInfos, numHints, messages } = report.issues;
  console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos, ${numHints} hints`);
  messages.slice(0, 20).forEach(m => console.log(`  ${m.code} ${m.pointer || ''} ${m.message}`));
  return numErrors + numWarnings === 0;
}

(async () => {
  let fine = true;
  for (const file of process.argv.slice(2)) fine = await check(file) && fine;
  process.exit(fine ? 0 : 1);
})().catch(e => { console.error(String(e)); process.exit(1); });
JS
node "$folder/validate.js" "$@"
