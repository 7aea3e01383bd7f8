// Writes three.tsv: poses of the sample models as three.js skins them (linear blending), by its own
// loader, its own clips and its own sums in double precision. Run it where npm has installed
// three@0.170.0, with the folder samples/models:
//
//   node three.mjs FOLDER > three.tsv

import { readFileSync } from 'node:fs';
import * as THREE from 'three';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';

// Model, clip, time in seconds. The last of each lies between keys, so that clips count as well.
const poses = [
  ['figure', 'walk', 0.375], ['figure', 'wave', 1], ['figure', 'walk', 0.4625],
  ['arm', 'bend', 0.75], ['arm', 'bend', 1.0417],
  ['bar', 'twist', 0.75], ['bar', 'twist', 1.19],
];
const verticesOf = { figure: 240, arm: 200, bar: 200 };

function load(path) {
  const file = readFileSync(path);
  const bytes = file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength);
  return new Promise((resolve, reject) => new GLTFLoader().parse(bytes, '', resolve, reject));
}

/// The skinned meshes in the order of the file, and where each begins.
function skinnedMeshes(scene) {
  const meshes = [];
  let count = 0;
  scene.traverse((node) => {
    if (!node.isSkinnedMesh) return;
    meshes.push({ mesh: node, first: count });
    count += node.geometry.attributes.position.count;
  });
  return { meshes, count };
}

function line(model, clip, time, vertex, bind, skinned) {
  const numbers = [bind.x, bind.y, bind.z, skinned.x, skinned.y, skinned.z];
  return [model, clip, time, vertex, ...numbers.map((n) => Number(n.toPrecision(9)))].join('\t');
}

console.log(`# three.js ${THREE.REVISION}, by three.mjs: linear blending`);
console.log('# model clip seconds vertex, its bind pose x y z, skinned x y z');
for (const [model, clip, time] of poses) {
  const gltf = await load(`${process.argv[2]}/${model}.glb`);
  const mixer = new THREE.AnimationMixer(gltf.scene);
  mixer.clipAction(THREE.AnimationClip.findByName(gltf.animations, clip)).play();
  mixer.setTime(time);
  gltf.scene.updateMatrixWorld(true);
  const { meshes, count } = skinnedMeshes(gltf.scene);
  for (let i = 0; i < verticesOf[model]; ++i) {
    const vertex = Math.floor(((i + 0.5) * count) / verticesOf[model]);
    const { mesh, first } = meshes.findLast((each) => each.first <= vertex);
    const bind = new THREE.Vector3().fromBufferAttribute(mesh.geometry.attributes.position, vertex - first);
    const skinned = mesh.localToWorld(mesh.applyBoneTransform(vertex - first, bind.clone()));
    console.log(line(model, clip, time, vertex, bind, skinned));
  }
}
