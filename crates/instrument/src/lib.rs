//! What an instrument is: description, plan, pose, frame, sample record; traits Stage and Camera. No I/O
