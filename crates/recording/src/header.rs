//! The head of a session: what is kept as attachments before the first pose.

use std::collections::BTreeMap;
use std::time::Duration;

use gonio_instrument::{CameraInfo, Certificate, Description, Plan, SampleRecord, StageIdentity};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::RecordingError;
use crate::layout::{FORMAT, VERSION, attachment};

/// What a session is about. Everything that a replay puts into results stands here or in the frames; the time of day does not.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The instrument.
    pub instrument: Description,
    /// The plan.
    pub plan: Plan,
    /// Who and what is scanned.
    pub sample: SampleRecord,
    /// Certificate of a reference sample.
    pub certificate: Option<Certificate>,
    /// The devices that were used.
    pub devices: Devices,
    /// Anything else worth knowing, as name and value: seed, accepted stale references, program version.
    pub provenance: BTreeMap<String, String>,
    /// More files to keep, such as the truth and the faults of a virtual instrument.
    pub attachments: Vec<Attachment>,
}

impl Header {
    /// A header of the three parts every session has.
    #[must_use]
    pub fn new(instrument: Description, plan: Plan, sample: SampleRecord) -> Self {
        Self {
            instrument,
            plan,
            sample,
            certificate: None,
            devices: Devices::default(),
            provenance: BTreeMap::new(),
            attachments: Vec::new(),
        }
    }
}

/// Identity of the devices behind the traits; a replay answers with the same.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Devices {
    /// The stage.
    pub stage: StageIdentity,
    /// The camera.
    pub camera: CameraInfo,
}

/// A file kept inside the session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Name; those of [`attachment`] are taken.
    pub name: String,
    /// Media type.
    pub media_type: String,
    /// Its bytes.
    pub data: Vec<u8>,
}

impl Attachment {
    /// An attachment of text.
    #[must_use]
    pub fn text(name: &str, media_type: &str, text: &str) -> Self {
        Self { name: name.to_owned(), media_type: media_type.to_owned(), data: text.as_bytes().to_owned() }
    }

    fn json<T: Serialize>(name: &'static str, value: &T) -> Result<Self, RecordingError> {
        let text = serde_json::to_string_pretty(value)
            .map_err(|e| RecordingError::Header { what: name, reason: e.to_string() })?;
        Ok(Self::text(name, "application/json", &text))
    }
}

/// `session.json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SessionRecord {
    /// Always [`FORMAT`].
    pub format: String,
    /// Version of the format.
    pub version: u32,
    /// Identity shared by all segments of the session.
    pub id: String,
    /// Number of this segment, from 1.
    pub segment: u32,
    /// When the segment was begun, ns since the Unix epoch.
    pub started_ns: u64,
    /// Number of poses in the plan.
    pub planned: u32,
}

impl SessionRecord {
    pub(crate) fn new(header: &Header, segment: u32, started: Duration) -> Result<Self, RecordingError> {
        let started_ns = crate::message::ns(started);
        let mut digest = Sha256::new();
        digest.update(started_ns.to_le_bytes());
        for part in
            [instrument(header)?, plan(header)?, Attachment::json(attachment::SAMPLE, &header.sample)?]
        {
            digest.update(&part.data);
        }
        let id = digest.finalize().iter().take(8).map(|b| format!("{b:02x}")).collect();
        let planned = u32::try_from(header.plan.poses().len()).unwrap_or(u32::MAX);
        Ok(Self { format: FORMAT.to_owned(), version: VERSION, id, segment, started_ns, planned })
    }
}

fn instrument(header: &Header) -> Result<Attachment, RecordingError> {
    let text = header
        .instrument
        .to_toml()
        .map_err(|e| RecordingError::Header { what: "instrument description", reason: e.to_string() })?;
    Ok(Attachment::text(attachment::INSTRUMENT, "application/toml", &text))
}

fn plan(header: &Header) -> Result<Attachment, RecordingError> {
    let text =
        header.plan.to_toml().map_err(|e| RecordingError::Header { what: "plan", reason: e.to_string() })?;
    Ok(Attachment::text(attachment::PLAN, "application/toml", &text))
}

/// Every attachment at the head of a segment, in the order written.
pub(crate) fn attachments(
    header: &Header,
    record: &SessionRecord,
) -> Result<Vec<Attachment>, RecordingError> {
    let mut all = vec![
        Attachment::json(attachment::SESSION, record)?,
        instrument(header)?,
        plan(header)?,
        Attachment::json(attachment::SAMPLE, &header.sample)?,
        Attachment::json(attachment::DEVICES, &header.devices)?,
        Attachment::json(attachment::PROVENANCE, &header.provenance)?,
    ];
    if let Some(c) = &header.certificate {
        all.push(Attachment::json(attachment::CERTIFICATE, c)?);
    }
    all.extend(header.attachments.iter().cloned());
    Ok(all)
}
