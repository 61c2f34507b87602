//! Protobuf descriptors of the messages, as viewers and the Python reader need them beside each channel.
//!
//! A schema is a serialised `google.protobuf.FileDescriptorSet` with every file the message needs. The sets are built here
//! from a table instead of by a compiler run, so that building needs no `protoc`. Names and field numbers of the `foxglove`
//! messages are those that Foxglove publishes for them.

use prost::Message as _;

use crate::layout::Topic;

/// `google.protobuf.FieldDescriptorProto.Type`.
#[derive(Clone, Copy)]
enum Type {
    Double = 1,
    Int64 = 3,
    Uint64 = 4,
    Int32 = 5,
    Fixed32 = 7,
    Bool = 8,
    String = 9,
    Message = 11,
    Bytes = 12,
    Uint32 = 13,
    Enum = 14,
}

#[derive(Clone, PartialEq, prost::Message)]
struct FileSet {
    #[prost(message, repeated, tag = "1")]
    file: Vec<File>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct File {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(string, tag = "2")]
    package: String,
    #[prost(string, repeated, tag = "3")]
    dependency: Vec<String>,
    #[prost(message, repeated, tag = "4")]
    message_type: Vec<Descriptor>,
    #[prost(string, tag = "12")]
    syntax: String,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Descriptor {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(message, repeated, tag = "2")]
    field: Vec<Field>,
    #[prost(message, repeated, tag = "4")]
    enum_type: Vec<Enumeration>,
    #[prost(message, repeated, tag = "8")]
    oneof_decl: Vec<OneOf>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Field {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(int32, tag = "3")]
    number: i32,
    #[prost(int32, tag = "4")]
    label: i32,
    #[prost(int32, tag = "5")]
    kind: i32,
    #[prost(string, optional, tag = "6")]
    type_name: Option<String>,
    #[prost(int32, optional, tag = "9")]
    oneof_index: Option<i32>,
    #[prost(bool, optional, tag = "17")]
    proto3_optional: Option<bool>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct OneOf {
    #[prost(string, tag = "1")]
    name: String,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Enumeration {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(message, repeated, tag = "2")]
    value: Vec<EnumerationValue>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct EnumerationValue {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(int32, tag = "2")]
    number: i32,
}

const TIMESTAMP: &str = "google/protobuf/timestamp.proto";

fn field(number: i32, name: &str, kind: Type) -> Field {
    Field { name: name.to_owned(), number, label: 1, kind: kind as i32, ..Field::default() }
}

fn typed(number: i32, name: &str, kind: Type, type_name: &str) -> Field {
    Field { type_name: Some(type_name.to_owned()), ..field(number, name, kind) }
}

fn file(topic: Topic, dependency: &[&str], message: Descriptor) -> File {
    let package = topic.schema().split('.').next().unwrap_or_default();
    File {
        name: topic.schema().replace('.', "/") + ".proto",
        package: package.to_owned(),
        dependency: dependency.iter().map(|&d| d.to_owned()).collect(),
        message_type: vec![message],
        syntax: "proto3".to_owned(),
    }
}

fn timestamp() -> File {
    File {
        name: TIMESTAMP.to_owned(),
        package: "google.protobuf".to_owned(),
        message_type: vec![Descriptor {
            name: "Timestamp".to_owned(),
            field: vec![field(1, "seconds", Type::Int64), field(2, "nanos", Type::Int32)],
            ..Descriptor::default()
        }],
        syntax: "proto3".to_owned(),
        ..File::default()
    }
}

fn enumeration(name: &str, values: &[&str]) -> Enumeration {
    let value =
        (0..).zip(values).map(|(number, &v)| EnumerationValue { name: v.to_owned(), number }).collect();
    Enumeration { name: name.to_owned(), value }
}

/// The serialised descriptor set of a channel's message.
pub(crate) fn descriptor_set(topic: Topic) -> Vec<u8> {
    let name = topic.schema().rsplit('.').next().unwrap_or_default().to_owned();
    let mut d = Descriptor { name, ..Descriptor::default() };
    let with_time = matches!(topic, Topic::Image | Topic::Event);
    if with_time {
        d.field.push(typed(1, "timestamp", Type::Message, ".google.protobuf.Timestamp"));
    }
    match topic {
        Topic::Image => d.field.extend([
            field(7, "frame_id", Type::String),
            field(2, "width", Type::Fixed32),
            field(3, "height", Type::Fixed32),
            field(4, "encoding", Type::String),
            field(5, "step", Type::Fixed32),
            field(6, "data", Type::Bytes),
        ]),
        Topic::Frame => {
            d.field.extend([
                field(1, "pose", Type::Uint32),
                field(2, "width", Type::Uint32),
                field(3, "height", Type::Uint32),
                field(4, "exposure_ns", Type::Uint64),
                field(5, "requested_ns", Type::Uint64),
                field(6, "lamp_monitor", Type::Double),
                field(7, "shutter_open", Type::Bool),
                field(8, "sequence", Type::Uint64),
                field(9, "stamp_ns", Type::Uint64),
                Field {
                    oneof_index: Some(0),
                    proto3_optional: Some(true),
                    ..field(10, "sensor_temperature_c", Type::Double)
                },
                field(11, "sha256", Type::Bytes),
            ]);
            // an optional field of proto3 is written as a choice of one
            d.oneof_decl.push(OneOf { name: "_sensor_temperature_c".to_owned() });
        }
        Topic::Pose => {
            d.enum_type.push(enumeration("State", &["UNKNOWN", "BEGUN", "DONE", "GIVEN_UP"]));
            d.field.extend([
                field(1, "index", Type::Uint32),
                typed(2, "state", Type::Enum, ".gonio.PoseInfo.State"),
                field(3, "commanded_tilt_rad", Type::Double),
                field(4, "commanded_spin_rad", Type::Double),
                field(5, "readback_tilt_rad", Type::Double),
                field(6, "readback_spin_rad", Type::Double),
                field(7, "frames", Type::Uint32),
                field(8, "tilt_deg", Type::Double),
                field(9, "spin_deg", Type::Double),
            ]);
        }
        Topic::Event => {
            d.enum_type
                .push(enumeration("Level", &["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"]));
            d.field.extend([
                typed(2, "level", Type::Enum, ".foxglove.Log.Level"),
                field(3, "message", Type::String),
                field(4, "name", Type::String),
                field(5, "file", Type::String),
                field(6, "line", Type::Fixed32),
            ]);
        }
        Topic::Wire => {
            d.field.extend([field(1, "from_device", Type::Bool), field(2, "bytes", Type::Bytes)]);
        }
        Topic::Sensors => d.field.extend([
            field(1, "lamp_monitor", Type::Double),
            field(2, "temperature_c", Type::Double),
            field(3, "sample_height_mm", Type::Double),
            field(4, "interlock_closed", Type::Bool),
        ]),
    }
    let mut set = FileSet::default();
    if with_time {
        set.file.push(timestamp());
    }
    set.file.push(file(topic, if with_time { &[TIMESTAMP] } else { &[] }, d));
    set.encode_to_vec()
}
