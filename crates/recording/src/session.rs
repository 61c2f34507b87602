//! A recorded session: its files, its parts, its poses one at a time.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use gonio_instrument::{Certificate, Description, Plan, Pose, PoseRecord, SampleRecord};
use serde::de::DeserializeOwned;

use crate::RecordingError;
use crate::chunk::{Chunk, RecordedPose};
use crate::header::{Attachment, Devices, Header, SessionRecord};
use crate::layout::{FORMAT, Topic, VERSION, attachment};
use crate::message::{Log, SensorReading, Wire};
use crate::paths::{continuations, segment_path};
use crate::seal::Kind;
use crate::segment::{ChunkEntry, Finding, ReadAttachment, Segment};
use crate::writer::{Direction, Level};

/// Where a pose lies; several where a continued scan took it again.
#[derive(Clone, Debug)]
pub(crate) struct PosePlace {
    pub segment: usize,
    pub chunk: ChunkEntry,
    pub commanded: Pose,
    pub frames: u32,
}

/// An open session with all its segments. Only heads are in memory; contents are read and checked when asked for.
#[derive(Debug)]
pub struct Session {
    path: PathBuf,
    pub(crate) segments: Vec<Segment>,
    pub(crate) records: Vec<Option<SessionRecord>>,
    attachments: BTreeMap<String, ReadAttachment>,
    poses: BTreeMap<u32, Vec<PosePlace>>,
    findings: Vec<Finding>,
}

/// An event of the session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Since the Unix epoch.
    pub time: Duration,
    /// How serious.
    pub level: Level,
    /// What happened.
    pub text: String,
}

/// Bytes on the wire.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WireBytes {
    /// Since the Unix epoch.
    pub time: Duration,
    /// Which way.
    pub direction: Direction,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// A note between and beside the frames, in the order written.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// An event.
    Event(Event),
    /// Bytes on the wire.
    Wire(WireBytes),
    /// What the sensors said, and when.
    Sensors(Duration, gonio_instrument::Sensors),
}

impl Session {
    /// Opens `S.mcap` and its continuation segments. A file that was never finished opens too, with what is whole in it.
    ///
    /// # Errors
    /// [`RecordingError::Absent`], [`RecordingError::Denied`], [`RecordingError::Io`] as the system says;
    /// [`RecordingError::NotASession`] for any other file, [`RecordingError::Version`] for a newer format. Damage is no error
    /// here: see [`Session::findings`].
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let mut s = Self {
            path: path.to_owned(),
            segments: Vec::new(),
            records: Vec::new(),
            attachments: BTreeMap::new(),
            poses: BTreeMap::new(),
            findings: Vec::new(),
        };
        s.add(Segment::open(path)?)?;
        let numbers = continuations(path);
        let mut expected = 2;
        for n in numbers {
            let part = segment_path(path, n);
            if n != expected {
                let what = format!("segment {expected} is missing before this one");
                s.findings.push(Finding { path: part.clone(), offset: 0, what });
            }
            expected = n + 1;
            match Segment::open(&part).and_then(|p| s.add(p)) {
                Ok(()) => {}
                Err(e) => s.findings.push(Finding { path: part, offset: 0, what: e.to_string() }),
            }
        }
        s.index_poses();
        Ok(s)
    }

    fn add(&mut self, segment: Segment) -> Result<(), RecordingError> {
        let (attachments, bad) = segment.read_attachments()?;
        let record = attachments
            .get(attachment::SESSION)
            .and_then(|a| serde_json::from_slice::<SessionRecord>(&a.data).ok());
        match &record {
            Some(r) if r.format != FORMAT => {
                let found = format!("its format is {:?}", r.format);
                return Err(RecordingError::NotASession { path: segment.path, found });
            }
            Some(r) if r.version > VERSION => {
                return Err(RecordingError::Version { path: segment.path, found: r.version, known: VERSION });
            }
            None if segment.seals.is_empty() => {
                let found = match &segment.profile {
                    Some(p) if p == FORMAT => "its head is incomplete".to_owned(),
                    Some(p) => format!("an MCAP file of profile {p:?}"),
                    None => "an MCAP file without a readable header".to_owned(),
                };
                return Err(RecordingError::NotASession { path: segment.path, found });
            }
            _ => {}
        }
        let first = self.records.first().and_then(Option::as_ref);
        if let (Some(f), Some(r)) = (first, &record)
            && f.id != r.id
        {
            let found = format!("it belongs to session {}, not {}", r.id, f.id);
            return Err(RecordingError::NotASession { path: segment.path, found });
        }
        self.findings.extend(segment.findings.iter().cloned());
        self.findings.extend(bad);
        for (name, a) in attachments {
            self.attachments.entry(name).or_insert(a);
        }
        self.records.push(record);
        self.segments.push(segment);
        Ok(())
    }

    fn index_poses(&mut self) {
        for (i, segment) in self.segments.iter().enumerate() {
            for chunk in &segment.chunks {
                let place = match &chunk.seal {
                    Some(s) if s.kind == Kind::Pose => {
                        let [tilt, spin] = s.commanded_radians;
                        Some((s.pose, Pose::from_radians(tilt, spin), s.frames))
                    }
                    Some(_) => None,
                    // its seal is damaged or was never written: look inside
                    None => segment
                        .chunk(chunk)
                        .ok()
                        .and_then(|c| c.pose().ok()?)
                        .map(|p| (p.record.index, p.record.commanded, p.record.exposures.len() as u32)),
                };
                if let Some((index, commanded, frames)) = place {
                    let p = PosePlace { segment: i, chunk: chunk.clone(), commanded, frames };
                    self.poses.entry(index).or_default().push(p);
                }
            }
        }
    }

    /// The file it was opened by.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Files of the session, the first segment first.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.segments.iter().map(|s| s.path.as_path())
    }

    /// What was found wrong while opening; [`crate::verify::verify`] looks further.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// Whether every segment was closed with its summary.
    #[must_use]
    pub fn finished(&self) -> bool {
        self.segments.iter().all(|s| s.finished)
    }

    /// Identity, number and start of the first segment.
    #[must_use]
    pub fn record(&self) -> Option<&SessionRecord> {
        self.records.iter().flatten().next()
    }

    /// Bytes of an attachment.
    #[must_use]
    pub fn attachment(&self, name: &str) -> Option<&[u8]> {
        self.attachments.get(name).map(|a| a.data.as_slice())
    }

    /// Names of the attachments that can be read.
    pub fn attachment_names(&self) -> impl Iterator<Item = &str> {
        self.attachments.keys().map(String::as_str)
    }

    pub(crate) fn read_attachments(&self) -> &BTreeMap<String, ReadAttachment> {
        &self.attachments
    }

    fn part(&self, name: &str) -> Result<&[u8], RecordingError> {
        self.attachment(name)
            .ok_or_else(|| RecordingError::NoSuchPart { path: self.path.clone(), name: name.to_owned() })
    }

    fn text(&self, name: &'static str) -> Result<&str, RecordingError> {
        std::str::from_utf8(self.part(name)?)
            .map_err(|e| RecordingError::Header { what: name, reason: e.to_string() })
    }

    fn json<T: DeserializeOwned>(&self, name: &'static str) -> Result<T, RecordingError> {
        serde_json::from_slice(self.part(name)?)
            .map_err(|e| RecordingError::Header { what: name, reason: e.to_string() })
    }

    /// The instrument.
    ///
    /// # Errors
    /// [`RecordingError::NoSuchPart`] where it is lost, [`RecordingError::Header`] where it cannot be used.
    pub fn instrument(&self) -> Result<Description, RecordingError> {
        Description::from_toml(self.text(attachment::INSTRUMENT)?)
            .map_err(|e| RecordingError::Header { what: attachment::INSTRUMENT, reason: e.to_string() })
    }

    /// The plan.
    ///
    /// # Errors
    /// As [`Session::instrument`].
    pub fn plan(&self) -> Result<Plan, RecordingError> {
        Plan::from_toml(self.text(attachment::PLAN)?)
            .map_err(|e| RecordingError::Header { what: attachment::PLAN, reason: e.to_string() })
    }

    /// The sample record.
    ///
    /// # Errors
    /// As [`Session::instrument`].
    pub fn sample(&self) -> Result<SampleRecord, RecordingError> {
        self.json(attachment::SAMPLE)
    }

    /// The certificate, where the session measures a reference that has one.
    ///
    /// # Errors
    /// [`RecordingError::Header`] where it cannot be used.
    pub fn certificate(&self) -> Result<Option<Certificate>, RecordingError> {
        if self.attachment(attachment::CERTIFICATE).is_none() {
            return Ok(None);
        }
        self.json(attachment::CERTIFICATE).map(Some)
    }

    /// The devices it was recorded with.
    ///
    /// # Errors
    /// As [`Session::instrument`].
    pub fn devices(&self) -> Result<Devices, RecordingError> {
        self.json(attachment::DEVICES)
    }

    /// What else was noted, as name and value.
    ///
    /// # Errors
    /// As [`Session::instrument`].
    pub fn provenance(&self) -> Result<BTreeMap<String, String>, RecordingError> {
        self.json(attachment::PROVENANCE)
    }

    /// The whole head again, as a continued scan wants it.
    ///
    /// # Errors
    /// As [`Session::instrument`].
    pub fn header(&self) -> Result<Header, RecordingError> {
        let extra = self.attachments.iter().filter(|(name, _)| !attachment::OURS.contains(&name.as_str()));
        Ok(Header {
            instrument: self.instrument()?,
            plan: self.plan()?,
            sample: self.sample()?,
            certificate: self.certificate()?,
            devices: self.devices()?,
            provenance: self.provenance()?,
            attachments: extra
                .map(|(name, a)| Attachment {
                    name: name.clone(),
                    media_type: a.media_type.clone(),
                    data: a.data.clone(),
                })
                .collect(),
        })
    }

    /// Indices of the poses that seem whole, ascending; whether they are is known when they are read.
    pub fn pose_indices(&self) -> impl Iterator<Item = u32> + '_ {
        self.poses.keys().copied()
    }

    /// Where each pose was commanded to, by index.
    pub fn commanded(&self) -> impl Iterator<Item = (u32, Pose)> + '_ {
        self.poses.iter().filter_map(|(&i, p)| Some((i, p.first()?.commanded)))
    }

    pub(crate) fn places(&self) -> &BTreeMap<u32, Vec<PosePlace>> {
        &self.poses
    }

    /// Number of frames of the poses that seem whole.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.poses.values().filter_map(|p| p.first()).map(|p| u64::from(p.frames)).sum()
    }

    /// One pose, checked to the last pixel; where it was taken twice, the first that is whole.
    ///
    /// # Errors
    /// [`RecordingError::NoSuchPose`] where there is none, [`RecordingError::Damaged`] where none is whole.
    pub fn pose(&self, index: u32) -> Result<RecordedPose, RecordingError> {
        let mut error = RecordingError::NoSuchPose { path: self.path.clone(), index };
        for place in self.poses.get(&index).into_iter().flatten() {
            match self.read_place(index, place) {
                Ok(p) => return Ok(p),
                Err(e) => error = e,
            }
        }
        Err(error)
    }

    pub(crate) fn read_place(&self, index: u32, place: &PosePlace) -> Result<RecordedPose, RecordingError> {
        let Some(segment) = self.segments.get(place.segment) else {
            return Err(RecordingError::NoSuchPose { path: self.path.clone(), index });
        };
        let damaged = |what: String| RecordingError::Damaged {
            path: segment.path.clone(),
            offset: place.chunk.offset,
            what: format!("pose {index}: {what}"),
        };
        let chunk = segment.chunk(&place.chunk)?;
        let pose = chunk.pose().map_err(damaged)?;
        match pose {
            Some(p) if p.record.index == index => Ok(p),
            Some(p) => Err(damaged(format!("the chunk holds pose {}", p.record.index))),
            None => Err(damaged("the chunk holds no whole pose".to_owned())),
        }
    }

    /// Every pose in the order of the plan, one in memory at a time. A damaged one comes as an error, and the next follows.
    pub fn poses(&self) -> impl Iterator<Item = Result<PoseRecord, RecordingError>> + '_ {
        self.poses.keys().map(|&i| self.pose(i).map(|p| p.record))
    }

    /// Events, bytes on the wire and sensor readings in the order written. Chunks that do not verify are skipped; one chunk is in
    /// memory at a time.
    pub fn notes(&self) -> impl Iterator<Item = Note> + '_ {
        self.segments
            .iter()
            .flat_map(|s| s.chunks.iter().filter_map(move |c| s.chunk(c).ok()))
            .flat_map(|chunk| notes_of(&chunk))
    }

    /// The events alone.
    pub fn events(&self) -> impl Iterator<Item = Event> + '_ {
        self.notes().filter_map(|n| if let Note::Event(e) = n { Some(e) } else { None })
    }

    /// The bytes on the wire alone.
    pub fn wire(&self) -> impl Iterator<Item = WireBytes> + '_ {
        self.notes().filter_map(|n| if let Note::Wire(w) = n { Some(w) } else { None })
    }
}

fn notes_of(chunk: &Chunk) -> Vec<Note> {
    use prost::Message as _;
    let note = |m: &crate::chunk::MessageAt| {
        let (payload, time) = (chunk.payload(m), Duration::from_nanos(m.time));
        match m.topic? {
            Topic::Event => {
                let e = Log::decode(payload).ok()?;
                Some(Note::Event(Event { time, level: Level::from_number(e.level), text: e.message }))
            }
            Topic::Wire => {
                let w = Wire::decode(payload).ok()?;
                let direction = if w.from_device { Direction::FromDevice } else { Direction::ToDevice };
                Some(Note::Wire(WireBytes { time, direction, bytes: w.bytes }))
            }
            Topic::Sensors => {
                let s = SensorReading::decode(payload).ok()?;
                let sensors = gonio_instrument::Sensors {
                    lamp_monitor: s.lamp_monitor,
                    temperature_c: s.temperature_c,
                    sample_height_mm: s.sample_height_mm,
                    interlock_closed: s.interlock_closed,
                };
                Some(Note::Sensors(time, sensors))
            }
            _ => None,
        }
    };
    chunk.messages.iter().filter_map(note).collect()
}
