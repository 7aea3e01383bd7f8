// What three.js' GLTFLoader makes of the files of the test GltfRules. The column "three" of
// tests/unit/gltf_rules.cpp was found by it, with three 0.187.0 (Node.js 20).
//
//   DERMIS_WRITE_RULES=/tmp/rules build/…/gltf_test --gtest_filter='GltfRules.*'
//   cd /tmp/some-empty-folder && npm install three@0.187.0
//   cp …/tests/gltf_rules/three.mjs . && node three.mjs /tmp/rules
//
// Prints a line for each file: its name, loads | misreads | refuses, and three's own message. Ends
// with 1 where that is not what expected.tsv says.
//
// loads: a skinned mesh comes out whose vertices are, half a second into the clip, where those of
// flawless.gltf are (or, for files that expected.tsv calls "other", all finite). misreads: something
// else comes out, or nothing ever.
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';

globalThis.self = globalThis;
globalThis.ProgressEvent ??= class ProgressEvent extends Event {};

const THREE = await import('three');
const { GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js');

const [folder, single] = process.argv.slice(2);
console.warn = () => {};

/// The vertices of all skinned meshes of the scene, half a second into the clip.
function skinnedVertices(gltf) {
  if (!gltf.scene) return [];
  if (gltf.animations.length > 0) {
    const mixer = new THREE.AnimationMixer(gltf.scene);
    mixer.clipAction(gltf.animations[0]).play();
    mixer.update(0.5);
  }
  gltf.scene.updateMatrixWorld(true);
  const vertices = [];
  gltf.scene.traverse((mesh) => {
    if (!mesh.isSkinnedMesh || vertices.length > 0) return;
    mesh.skeleton.update();
    // getVertexPosition looks at indices of the index, too.
    const vertex = new THREE.Vector3();
    const count = mesh.geometry.attributes.position.count;
    for (let i = 0; i < count; ++i) vertices.push(...mesh.getVertexPosition(i, vertex).toArray());
    const index = mesh.geometry.index;
    if (index) for (let i = 0; i < Math.min(3, index.count); ++i) vertices.push(index.getX(i));
  });
  return vertices;
}

async function load(name) {
  const bytes = readFileSync(join(folder, name));
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  const data = name.endsWith('.glb') ? buffer : new TextDecoder().decode(buffer);
  const complaints = [];
  console.error = (...parts) => complaints.push(parts.join(' '));
  try {
    return { vertices: skinnedVertices(await new GLTFLoader().parseAsync(data, folder + '/')),
             complaints };
  } catch (error) {
    return { error: String(error.message ?? error).split('\n')[0] };
  }
}

// In a process of its own: some files make it loop for ever.
function loadApart(name) {
  try {
    const output = execFileSync(process.execPath, [process.argv[1], folder, name],
                                { timeout: 20000, stdio: ['ignore', 'pipe', 'ignore'] });
    return JSON.parse(output.toString());
  } catch {
    return { vertices: [], complaints: ['it hangs'] };
  }
}

if (single) {
  console.log(JSON.stringify(await load(single), (_, value) =>
    typeof value === 'number' && !Number.isFinite(value) ? null : value));
  process.exit(0);
}

const same = (a, b) => a.length === b.length && a.every((x, i) => Number.isFinite(x) && Math.abs(x - b[i]) < 1e-3);
const flawless = loadApart('flawless.gltf').vertices;
if (!flawless || flawless.length === 0) throw new Error('flawless.gltf does not load');

let failures = 0;
for (const line of readFileSync(join(folder, 'expected.tsv'), 'utf8').trim().split('\n')) {
  const [name, expected, meaning] = line.split('\t');
  const result = loadApart(name);
  let verdict = 'refuses';
  if (!result.error) {
    const good = meaning === 'same' ? same(result.vertices, flawless)
        : result.vertices.length > 0 && result.vertices.every(Number.isFinite);
    verdict = good ? 'loads' : 'misreads';
  }
  const agrees = verdict === expected;
  if (!agrees) ++failures;
  console.log([name, verdict, agrees ? '' : `EXPECTED ${expected}`,
               result.error ?? result.complaints.join('; ')].join('\t'));
}
console.log(`${failures} differ from expected.tsv; three ${THREE.REVISION}`);
process.exit(failures === 0 ? 0 : 1);
