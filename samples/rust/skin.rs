//! Skins a crowd of a glTF model on all cores of the CPU, and checks every vertex against the reference.
//!
//!     skin MODEL.glb [FIGURES]
//!
//! There is no binding code: bindgen makes dermis.rs from the header.
//!
//!     bindgen --no-prepend-enum-name --allowlist-function 'dermis.*' --allowlist-var 'DERMIS.*' dermis.h -o dermis.rs
//!     rustc -O skin.rs $(pkg-config --libs dermis-c-compare)
//!
//! Exit status: 0 success, 1 a vertex is wrong or something failed.
#![allow(non_camel_case_types, non_upper_case_globals, dead_code, deref_nullptr)]

use std::ffi::{CStr, CString};
use std::mem::{size_of, zeroed};
use std::ptr::{copy_nonoverlapping, null, null_mut};
use std::sync::atomic::{AtomicU32, Ordering};

mod dermis {
    include!("dermis.rs");
}
use dermis::*;

/// Calls a function of Dermis, and passes its error on as a text.
fn must(call: impl FnOnce(*mut dermis_error) -> dermis_code) -> Result<(), String> {
    let mut error: dermis_error = unsafe { zeroed() };
    if call(&mut error) == DERMIS_OK {
        return Ok(());
    }
    Err(unsafe { CStr::from_ptr(error.message.as_ptr()) }.to_string_lossy().into_owned())
}

/// A structure of zeros with its size, for those that begin with it.
macro_rules! sized {
    ($type:ident) => {
        $type { size: size_of::<$type>() as u32, ..unsafe { zeroed() } }
    };
}

/// An object of Dermis, which this destroys.
struct Owned<T>(*mut T);
impl<T> Drop for Owned<T> {
    fn drop(&mut self) {
        unsafe { dermis_destroy(self.0 as *mut _) }
    }
}

/// Threads may run the jobs of a frame at the same time.
#[derive(Clone, Copy)]
struct Jobs(*const dermis_runner);
unsafe impl Send for Jobs {}
impl Jobs {
    fn run(&self, index: u32) -> dermis_code {
        unsafe { dermis_run_job(self.0, index, null_mut()) }
    }
}

/// One skinned primitive of one figure.
struct Part {
    primitive: dermis_primitive,
    pose: dermis_pose,
    instance: dermis_instance,
    joints: Vec<dermis_joint>,
}

fn skin(path: &str, figures: u32) -> Result<bool, String> {
    let path = CString::new(path).map_err(|error| error.to_string())?;
    let source = dermis_model_source { path: path.as_ptr(), missing_normals: DERMIS_NORMALS_SMOOTH, ..sized!(dermis_model_source) };
    let mut model = Owned::<dermis_model>(null_mut());
    must(|error| unsafe { dermis_model_load(&source, &mut model.0, error) })?;
    let mut contents = sized!(dermis_model_info);
    must(|error| unsafe { dermis_model_contents(model.0, &mut contents, error) })?;
    let (clip, duration) = match contents.clip_count {
        0 => (DERMIS_REST_POSE as u32, 0.0),
        _ => (0, unsafe { *contents.clips }.duration),
    };
    let mut runner = Owned::<dermis_runner>(null_mut());
    must(|error| unsafe { dermis_runner_create(null(), &mut runner.0, error) })?;
    let scene = unsafe { dermis_runner_scene(runner.0) };

    let mut parts = Vec::new();
    for index in 0..contents.primitive_count {
        let mut primitive = sized!(dermis_primitive);
        must(|error| unsafe { dermis_model_primitive(model.0, index, &mut primitive, error) })?;
        if unsafe { *primitive.mesh }.influence_set_count == 0 {
            continue;
        }
        let mut packed = Owned::<dermis_packed>(null_mut());
        must(|error| unsafe { dermis_pack(primitive.mesh, primitive.joint_count, &mut packed.0, error) })?;
        let mut figure = sized!(dermis_instance_desc);
        figure.layout.normals = DERMIS_FORMAT_FLOAT32X3;
        must(|error| unsafe { dermis_add_mesh(scene, packed.0, &mut figure.mesh, error) })?;
        let desc = dermis_pose_desc { joint_count: primitive.joint_count, ..sized!(dermis_pose_desc) };
        let mut poses: Vec<dermis_pose> = vec![unsafe { zeroed() }; figures as usize];
        must(|error| unsafe { dermis_add_poses(scene, &desc, figures, poses.as_mut_ptr(), error) })?;
        for (number, pose) in poses.into_iter().enumerate() {
            figure.pose = pose;
            let mut instance = unsafe { zeroed() };
            must(|error| unsafe { dermis_add_instance(scene, &figure, &mut instance, error) })?;
            // Each figure plays the first clip with an offset of its own.
            let time = duration * number as f64 / figures as f64;
            let mut joints: Vec<dermis_joint> = vec![unsafe { zeroed() }; primitive.joint_count as usize];
            must(|error| unsafe {
                dermis_model_pose(model.0, index, clip, time, joints.as_mut_ptr(), primitive.joint_count, null_mut(), 0, error)
            })?;
            parts.push(Part { primitive, pose, instance, joints });
        }
    }

    must(|error| unsafe { dermis_begin_frame(scene, 1, 0, error) })?;
    let poses: Vec<dermis_pose> = parts.iter().map(|part| part.pose).collect();
    let mut memory = vec![null_mut(); poses.len()];
    must(|error| unsafe {
        dermis_write_poses(scene, poses.as_ptr(), poses.len() as u32, memory.as_mut_ptr(), null_mut(), error)
    })?;
    for (part, memory) in parts.iter().zip(memory) {
        // The memory is only written. A slice of it would promise that it can be read.
        unsafe { copy_nonoverlapping(part.joints.as_ptr(), memory, part.joints.len()) };
    }
    let mut frame = sized!(dermis_runner_frame);
    must(|error| unsafe { dermis_runner_jobs(runner.0, 0, &mut frame, error) })?;
    let (next, count, jobs) = (AtomicU32::new(0), frame.job_count, Jobs(runner.0));
    let cores = std::thread::available_parallelism().map_or(1, |count| count.get());
    let failed = std::thread::scope(|scope| {
        let next = &next;
        let threads: Vec<_> = (0..cores)
            .map(|_| {
                scope.spawn(move || loop {
                    match next.fetch_add(1, Ordering::Relaxed) {
                        job if job >= count => break false,
                        job if jobs.run(job) != DERMIS_OK => break true,
                        _ => {}
                    }
                })
            })
            .collect();
        threads.into_iter().any(|thread| thread.join().unwrap_or(true))
    });
    if failed {
        return Err("a job failed".into());
    }

    let (mut vertices, mut worst, mut passed) = (0, 0.0f64, true);
    for part in &parts {
        let mut place = sized!(dermis_instance_info);
        must(|error| unsafe { dermis_instance_contents(scene, part.instance, &mut place, error) })?;
        let attribute = |stream: usize| dermis_skinned_attribute {
            data: (frame.output as *const u8).wrapping_add(place.places.streams[stream].offset as usize) as *const _,
            stride: place.places.streams[stream].stride,
            format: place.places.streams[stream].format,
        };
        let count = unsafe { *part.primitive.mesh }.vertex_count;
        let skinned = dermis_skinned_view { vertex_count: count, positions: attribute(0), normals: attribute(1), ..sized!(dermis_skinned_view) };
        let posed = dermis_posed_mesh {
            mesh: part.primitive.mesh,
            joints: part.joints.as_ptr(),
            joint_count: part.primitive.joint_count,
            ..sized!(dermis_posed_mesh)
        };
        let mut comparison = sized!(dermis_comparison);
        must(|error| unsafe { dermis_compare(&posed, &skinned, &mut comparison, error) })?;
        vertices += count;
        worst = worst.max(comparison.worst_position);
        passed = passed && comparison.passed != 0;
    }
    let verdict = if passed { "every one is right" } else { "some are WRONG" };
    println!("{vertices} vertices of {figures} figures: {verdict}, worst position error {:.0} % of its bound", 100.0 * worst);
    Ok(passed && vertices > 0)
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let figures = arguments.get(2).and_then(|text| text.parse().ok()).unwrap_or(9);
    let result = match arguments.get(1) {
        Some(path) => skin(path, figures),
        None => Err("usage: skin MODEL.glb [FIGURES]".into()),
    };
    match result {
        Ok(true) => {}
        Ok(false) => std::process::exit(1),
        Err(message) => {
            eprintln!("{message}");
            std::process::exit(1)
        }
    }
}
