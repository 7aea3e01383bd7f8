// Prints the errors of the glTF validator: a line for each file and code, with the number of errors.
// A file without errors has a line with the code "none". Arguments: names of a folder in the table,
// each followed by the folder itself.
import { createRequire } from 'node:module';
import { readFile, readdir } from 'node:fs/promises';
import { dirname, join } from 'node:path';

const validator = createRequire(join(process.cwd(), 'x'))('gltf-validator');

async function errorsOf(path) {
  const options = {
    maxIssues: 0, // no maximum
    externalResourceFunction: async (uri) =>
      new Uint8Array(await readFile(join(dirname(path), decodeURIComponent(uri)))),
  };
  const counts = new Map();
  try {
    const report = await validator.validateBytes(new Uint8Array(await readFile(path)), options);
    for (const { severity, code } of report.issues.messages)
      if (severity === 0) counts.set(code, (counts.get(code) ?? 0) + 1);
  } catch {
    counts.set('exception', 1); // of the validator: it cannot read the file
  }
  return counts.size === 0 ? new Map([['none', 0]]) : counts;
}

console.log(`# gltf-validator ${validator.version()}: errors by file and code, made by make_table.sh`);
const folders = process.argv.slice(2);
for (let i = 0; i < folders.length; i += 2) {
  const files = (await readdir(folders[i + 1], { recursive: true }))
    .filter((file) => /\.(gltf|glb)$/.test(file)).sort();
  for (const file of files)
    for (const [code, count] of [...await errorsOf(join(folders[i + 1], file))].sort())
      console.log([`${folders[i]}/${file}`, code, count].join('\t'));
}
