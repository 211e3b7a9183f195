//! Which engine runs the graphs? A real ONNX Runtime library if one is found, else tract.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock};

use ort::environment::Environment;

/// API version that the tract backend fixes at build time; older libraries are passed over.
const API_VERSION: u32 = 24;

/// The engine in use, chosen once per process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Runtime {
    /// `onnxruntime` or `tract`.
    pub name: &'static str,
    /// Version, as the library tells.
    pub version: String,
    /// The library's file, for a real ONNX Runtime.
    pub path: Option<PathBuf>,
}

static RUNTIME: OnceLock<(Runtime, Environment)> = OnceLock::new();

/// The engine of this process. The first call decides: `path` if given, `ORT_DYLIB_PATH`, the
/// directory of the executable, the system's library path, and otherwise tract, which is built in.
///
/// # Errors
/// A `path` that was asked for but cannot be used.
pub fn runtime(path: Option<&Path>) -> Result<&'static (Runtime, Environment), String> {
    // One thread decides; the others wait, as engines do not like to be started twice.
    static DECIDING: Mutex<()> = Mutex::new(());
    let _deciding = DECIDING
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(found) = RUNTIME.get() {
        return Ok(found);
    }
    let runtime = match path {
        Some(path) => open(path)
            .ok_or_else(|| format!("{} is no ONNX Runtime >= 1.{API_VERSION}", path.display()))?,
        None => candidates()
            .iter()
            .find_map(|p| open(p))
            .unwrap_or_else(|| {
                ort::set_api(ort_tract::api());
                Runtime {
                    name: "tract",
                    version: "0.23".into(),
                    path: None,
                }
            }),
    };
    let environment = ort::init()
        .build()
        .map_err(|e| format!("the ONNX engine does not start: {e}"))?;
    Ok(RUNTIME.get_or_init(|| (runtime, environment)))
}

fn candidates() -> Vec<PathBuf> {
    let name = if cfg!(windows) {
        "onnxruntime.dll"
    } else if cfg!(target_os = "macos") {
        "libonnxruntime.dylib"
    } else {
        "libonnxruntime.so"
    };
    let mut paths = Vec::new();
    paths.extend(std::env::var_os("ORT_DYLIB_PATH").map(PathBuf::from));
    if let Some(directory) = std::env::current_exe()
        .ok()
        .as_deref()
        .and_then(Path::parent)
    {
        paths.push(directory.join(name));
    }
    // A bare name is looked up by the system's loader.
    paths.push(PathBuf::from(name));
    paths
}

/// Loads a library and makes its table the process's API, if its version suffices.
#[expect(
    unsafe_code,
    reason = "a C library found at run time; the checks follow its documented protocol"
)]
fn open(path: &Path) -> Option<Runtime> {
    if path.components().count() > 1 && !path.exists() {
        return None;
    }
    // SAFETY: the symbol is ONNX Runtime's documented entry point with this signature; the library
    // is leaked on purpose, so that its tables stay valid for the rest of the process.
    unsafe {
        let library = Box::leak(Box::new(libloading::Library::new(path).ok()?));
        let entry: libloading::Symbol<
            '_,
            unsafe extern "system" fn() -> *const ort::sys::OrtApiBase,
        > = library.get(b"OrtGetApiBase").ok()?;
        let base = entry().as_ref()?;
        let api = (base.GetApi)(API_VERSION).as_ref()?;
        let version = std::ffi::CStr::from_ptr((base.GetVersionString)());
        ort::set_api(api.clone());
        Some(Runtime {
            name: "onnxruntime",
            version: version.to_string_lossy().into_owned(),
            path: Some(path.to_owned()),
        })
    }
}
