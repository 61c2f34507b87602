//! The schema and channel records. They open every chunk, so that a chunk can be read whatever became of the others.

use crate::encode;
use crate::layout::Topic;
use crate::schema::descriptor_set;

/// All schema records, then all channel records.
pub(crate) fn definitions() -> Vec<u8> {
    let mut out = Vec::new();
    for t in Topic::ALL {
        encode::schema(&mut out, t.id(), t.schema(), "protobuf", &descriptor_set(t));
    }
    for t in Topic::ALL {
        encode::channel(&mut out, t.id(), t.id(), t.name(), "protobuf");
    }
    out
}

/// Length of the run of schema records at the head of [`definitions`].
pub(crate) fn schemas_length(definitions: &[u8]) -> usize {
    let mut b = crate::bytes::Bytes::new(definitions);
    let mut length = 0;
    while let Some((crate::layout::op::SCHEMA, body)) = b.record() {
        length += crate::layout::RECORD_HEAD as usize + body.len();
    }
    length
}
