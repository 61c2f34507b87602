//! Transports, the stage client, camera back ends
