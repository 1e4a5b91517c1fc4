//! `spf tello status` with a scripted drone, whose state lines are those of another firmware.

use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::address::own_address;
use crate::harness::{Lab, Run};

/// Interval of state lines, as a Tello sends them.
const INTERVAL: Duration = Duration::from_millis(100);

/// Runs `spf tello status` on a drone that sends this line, with the number of the line in place of `N` and its motor time in place
/// of `T`.
fn status(line: &str) -> Run {
    let lab = Lab::new();
    // Where its state is received.
    let own = own_address();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(INTERVAL)).unwrap();
    let drone = socket.local_addr().unwrap();
    let (line, over) = (line.to_owned(), Arc::new(AtomicBool::new(false)));
    let until = over.clone();
    let sending = std::thread::spawn(move || {
        let mut buffer = [0; 100];
        for number in 0_u32.. {
            if until.load(Ordering::Relaxed) {
                return;
            }
            if let Ok((length, from)) = socket.recv_from(&mut buffer) {
                let answer = if &buffer[..length] == b"command" { "ok" } else { "unknown command" };
                socket.send_to(answer.as_bytes(), from).unwrap();
            }
            let text = line.replace('N', &number.to_string()).replace('T', &(number / 10).to_string());
            // Until the program listens, the system tells that nobody does.
            drop(socket.send_to(text.as_bytes(), own));
        }
    });
    let mut command = lab.command(&["tello", "status", "--drone", &format!("tello@{drone}")]);
    command.env("SPF_TELLO_LOCAL", own.ip().to_string()).env("SPF_TELLO_STATE_PORT", own.port().to_string());
    let run = Run::of(&command.output().unwrap());
    over.store(true, Ordering::Relaxed);
    sending.join().unwrap();
    run
}

#[test]
fn a_state_without_a_sign_of_the_ground_is_unknown_and_no_ground() {
    let run = status("pitch:0;roll:0;yaw:0;h:0.80 m;tof:;bat:87.00;time:?;agx:N.00;\r\n");
    assert_eq!(run.code, Some(6), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.starts_with("unknown whether on the ground or in the air\n"), "{}", run.stdout);
    for words in ["battery 87 %", "height above take-off point unknown", "distance to the surface below unknown"] {
        assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
    }
    for words in ["waiting for up to 2 s for its state …", "whether its motors turn …", "speed, height, motor time"] {
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
}

#[test]
fn a_state_of_another_firmware_is_read_where_it_is_clear() {
    let run = status(" PITCH = 0.00, Roll=0.00, yaw=0.00, h=80.00, tof= 90.0, bat=87.00, time=T.00, agx=N\r\n");
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.starts_with("in the air\n"), "{}", run.stdout);
    assert!(run.stdout.contains("battery 87 %\nheight above take-off point 80 cm\n"), "{}", run.stdout);
    let run = status("pitch:0.00;roll:0.00;yaw:0.00;h:0.00;tof:10.00;bat:87.00;time:12.00;agx:N.00;\r\n");
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.starts_with("on the ground\n"), "{}", run.stdout);
}

#[test]
fn a_state_that_cannot_be_read_is_no_silence() {
    let run = status("state of another kind, line N");
    assert_eq!(run.code, Some(6), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.is_empty() && run.stderr.contains("but none is a state that can be read"), "{}{}", run.stdout, run.stderr);
}
