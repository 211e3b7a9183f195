//! What exactly was run? Everything that decides a result, and nothing that does not: no times.

use serde::{Deserialize, Serialize};

/// `manifest.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the contract.
    pub contract: u32,
    /// Version of this program.
    pub version: String,
    /// Physics engine and version.
    pub engine: String,
    /// blake3 of everything below down to `objects`: two runs with the same id give the same rows.
    pub run_id: String,
    /// Name and version of the protocol, and every constant by its `--set` name.
    pub protocol: serde_json::Value,
    /// Thresholds of the geometric classifier.
    pub classifier: serde_json::Value,
    /// The hand, whole.
    pub gripper: serde_json::Value,
    /// Where the grasps come from: files with their hashes, a sampler with its settings, or a model
    /// with its card and the runtime that ran it.
    pub grasps: serde_json::Value,
    /// Which grasps and stages were chosen.
    pub selection: serde_json::Value,
    /// The run's seed.
    pub seed: u64,
    /// The objects in the order of the rows.
    pub objects: Vec<ManifestObject>,
    /// The command line.
    pub command: Vec<String>,
    /// Operating system and architecture.
    pub platform: String,
}

/// One object of a manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ManifestObject {
    /// Its identity in the rows.
    pub id: String,
    /// The mesh file or shape it was made of.
    pub mesh: String,
    /// What decides the object besides its mesh: scale, mass, density, friction.
    pub properties: serde_json::Value,
    /// blake3 of the source: mesh file and grasp file bytes, or the shape's parameters.
    pub source_hash: String,
    /// blake3 of the mesh alone: mesh file bytes, or the shape's parameters.
    #[serde(default)]
    pub mesh_hash: String,
}

impl Manifest {
    /// The bytes of `manifest.json`.
    pub fn to_text(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("a manifest is plain data");
        text.push('\n');
        text
    }

    /// The manifest of the run that this is a shard of.
    #[must_use]
    pub fn unsharded(mut self) -> Self {
        self.selection["shard"] = serde_json::Value::Null;
        self.sealed()
    }

    /// Fills in [`Manifest::run_id`].
    #[must_use]
    pub fn sealed(mut self) -> Self {
        let decides = serde_json::json!([
            self.contract,
            self.version,
            self.engine,
            self.protocol,
            self.classifier,
            self.gripper,
            self.grasps,
            self.selection,
            self.seed,
            self.objects,
            self.platform,
        ]);
        self.run_id = blake3::hash(decides.to_string().as_bytes()).to_hex()[..16].to_owned();
        self
    }
}
