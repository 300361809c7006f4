//! A portal of the tests is asked, over a socket of its own and over a bus of its own.

use std::io::{BufRead, BufReader};
use std::os::unix::net::UnixStream;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};

use zbus::Guid;

use super::*;

const HANDLE: &str = "/org/freedesktop/portal/desktop/request/1_1/t";
const PATIENCE: Duration = Duration::from_secs(30);

/// What a portal does once it is asked for a file.
#[derive(Clone, Copy)]
enum Portal {
    /// It responds with a code and URIs.
    Responds(u32, &'static [&'static str]),
    /// It shows a dialog that nobody answers.
    Shows,
    /// It says nothing at all.
    Hangs,
    /// It has no chooser of files.
    Refuses,
    /// It is of another version.
    Of(u32),
}

/// What a portal was told: the method, its strings, and its options as text.
type Told = (String, Vec<String>, HashMap<String, String>);

/// Serves as a portal until the connection ends.
async fn serve(connection: Connection, portal: Portal, told: Sender<Told>) -> zbus::Result<()> {
    let mut calls = MessageStream::from(&connection);
    while let Some(call) = poll_fn(|context| Pin::new(&mut calls).poll_next(context)).await {
        let call = call?;
        let header = call.header();
        let Some(method) = header.member().filter(|_| call.message_type() == Type::MethodCall) else {
            continue;
        };
        let version = if let Portal::Of(version) = portal { version } else { 4 };
        let tell = |strings, options| told.send((method.to_string(), strings, options)).expect("a test");
        match (method.as_str(), portal) {
            ("Get", Portal::Refuses) => {
                connection
                    .reply_error(&header, "org.freedesktop.DBus.Error.InvalidArgs", &"no chooser")
                    .await?;
            }
            ("Get", _) => connection.reply(&header, &Variant::U32(version)).await?,
            ("Close", _) => {
                tell(vec![header.path().expect("a path").to_string()], HashMap::new());
                connection.reply(&header, &()).await?;
            }
            (_, Portal::Hangs) => tell(Vec::new(), HashMap::new()),
            _ => {
                let body = call.body();
                let (parent, title, options): (String, String, HashMap<String, OwnedVariant>) =
                    body.deserialize()?;
                let options = options.into_iter().map(|(key, value)| (key, value.to_string())).collect();
                tell(vec![parent, title], options);
                if let Portal::Responds(code, uris) = portal {
                    // One of another program comes first, and ours may come before its handle.
                    let other = HashMap::from([("uris", Variant::from(vec!["file:///other"]))]);
                    let ours = HashMap::from([("uris", Variant::from(uris.to_vec()))]);
                    for (path, body) in [("/other", (0, other)), (HANDLE, (code, ours))] {
                        let nobody = None::<&str>;
                        connection.emit_signal(nobody, path, REQUEST, "Response", &body).await?;
                    }
                }
                connection.reply(&header, &OwnedObjectPath::try_from(HANDLE)?).await?;
            }
        }
    }
    Ok(())
}

fn question(wanted: Wanted) -> Question {
    let endings = &[".nii.gz", ".mha"];
    Question { title: "A title", button: "Do it", wanted, endings, folder: "/data/Kopf Ü".into() }
}

/// A dialog that was asked for, what the portal was told of it, and what comes with the answer.
struct Asked {
    dialog: Option<Pending>,
    told: Receiver<Told>,
    woken: Receiver<()>,
}

impl Asked {
    fn of(portal: Portal, wanted: Wanted) -> Self {
        let (ours, its) = UnixStream::pair().expect("a socket");
        let (tell, told) = channel();
        std::thread::spawn(move || {
            zbus::block_on(async {
                let server = Builder::unix_stream(its).server(Guid::generate()).p2p();
                serve(server.build().await.expect("a connection"), portal, tell).await
            })
        });
        Self::over(move || Builder::unix_stream(ours).p2p(), told, wanted)
    }

    fn over(
        bus: impl FnOnce() -> Builder<'static> + Send + 'static,
        told: Receiver<Told>,
        wanted: Wanted,
    ) -> Self {
        let (wake, woken) = channel();
        let wake = move || wake.send(()).expect("a test");
        Asked { dialog: Some(ask_over(bus, question(wanted), "x11:2a".into(), wake)), told, woken }
    }

    fn reply(&self) -> Reply {
        self.woken.recv_timeout(PATIENCE).expect("the window is woken");
        self.dialog.as_ref().expect("not dropped").reply().expect("an answer")
    }

    fn told(&self) -> Told {
        self.told.recv_timeout(PATIENCE).expect("the portal is asked")
    }
}

#[test]
fn a_response_is_an_answer() {
    let chosen = |paths: &[&str]| Reply::Chosen(paths.iter().map(PathBuf::from).collect());
    for (portal, expected) in [
        (Portal::Responds(0, &["file:///a/b.nii"]), chosen(&["/a/b.nii"])),
        (
            Portal::Responds(0, &["file:///Kopf%20%C3%9C/100%25.ply", "file://localhost/b"]),
            chosen(&["/Kopf Ü/100%.ply", "/b"]),
        ),
        (Portal::Responds(0, &["file:///a", "sftp://host/b"]), chosen(&[])),
        (Portal::Responds(0, &[]), chosen(&[])),
        (Portal::Responds(1, &[]), Reply::Cancelled),
        (Portal::Responds(2, &[]), Reply::Unavailable),
        (Portal::Of(2), Reply::Unavailable),
        (Portal::Refuses, Reply::Unavailable),
        (Portal::Hangs, Reply::Unavailable),
    ] {
        assert_eq!(Asked::of(portal, Wanted::Files).reply(), expected);
    }
}

#[test]
fn a_dialog_that_is_closed_late_was_seen() {
    let code = |code, after| reply_of(code, HashMap::new(), after);
    assert!(code(2, AT_ONCE / 2).is_err(), "nothing was shown");
    assert_eq!(code(2, AT_ONCE).expect("an answer"), Reply::Cancelled);
    assert!(code(0, AT_ONCE).is_err(), "it names nothing");
}

#[test]
fn a_portal_is_told_what_the_question_is() {
    let told = |wanted| Asked::of(Portal::Responds(1, &[]), wanted).told();
    let (method, strings, mut options) = told(Wanted::New("neu ü.nii.gz".into()));
    assert_eq!((method.as_str(), strings), ("SaveFile", vec!["x11:2a".into(), "A title".into()]));
    let filters = r#"[(".nii.gz, .mha", [(uint32 0, "*.[nN][iI][iI].[gG][zZ]"), (0, "*.[mM][hH][aA]")]), ("All files", [(0, "*")])]"#;
    let same = [("accept_label", "\"Do it\""), ("filters", filters)];
    assert_eq!(options.remove("current_name").as_deref(), Some("\"neu ü.nii.gz\""));
    for (key, value) in same {
        assert_eq!(options.remove(key).as_deref(), Some(value), "{key}");
    }
    let folder = options.remove("current_folder").expect("a folder");
    assert_eq!(folder, Variant::from(b"/data/Kopf \xc3\x9c\0".to_vec()).to_string());
    assert!(options.is_empty(), "{options:?}");
    for (wanted, own) in [(Wanted::Files, "multiple"), (Wanted::Folder, "directory")] {
        let (method, _, options) = told(wanted.clone());
        assert_eq!((method.as_str(), options[own].as_str()), ("OpenFile", "true"));
        assert_eq!(options.contains_key("filters"), wanted != Wanted::Folder);
    }
    let (method, _, options) = told(Wanted::File);
    assert!(method == "OpenFile" && !options.contains_key("multiple"), "{options:?}");
}

#[test]
fn a_dialog_that_nobody_waits_for_is_closed() {
    let mut asked = Asked::of(Portal::Shows, Wanted::File);
    assert_eq!(asked.told().0, "OpenFile");
    assert_eq!(asked.dialog.as_ref().and_then(Pending::reply), None, "it is open");
    asked.dialog = None;
    assert_eq!(asked.told(), ("Close".into(), vec![HANDLE.into()], HashMap::new()));
}

#[test]
fn a_portal_is_found_on_the_bus() {
    let folder = tempfile::tempdir().expect("a folder");
    // Without services that the bus would start: a desktop's own portal is none of ours.
    let config = folder.path().join("bus.conf");
    let listen = folder.path().display();
    let text = format!(
        "<busconfig><listen>unix:dir={listen}</listen><policy context=\"default\"><allow own=\"*\"/>\
         <allow send_destination=\"*\"/><allow receive_sender=\"*\"/></policy></busconfig>"
    );
    std::fs::write(&config, text).expect("a file");
    let daemon = Command::new("dbus-daemon")
        .args(["--nofork", "--print-address", "--config-file"])
        .arg(&config)
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut daemon) = daemon else {
        println!("skipped: there is no dbus-daemon");
        return;
    };
    let mut address = String::new();
    BufReader::new(daemon.stdout.take().expect("its output")).read_line(&mut address).expect("an address");
    let address = address.trim().to_owned();
    assert!(address.starts_with("unix:"), "{address:?}");
    let bus = |address: &str| {
        let address = address.to_owned();
        move || Builder::address(address.as_str())
    };
    let over = |address: &str, told| Asked::over(bus(address), told, Wanted::File).reply();
    assert_eq!(over(&address, channel().1), Reply::Unavailable, "there is no portal");
    let (tell, told) = channel();
    let (ready, is_ready) = channel();
    let server = bus(&address);
    std::thread::spawn(move || {
        zbus::block_on(async {
            let connection = server().build().await.expect("a connection");
            connection.request_name(PORTAL).await.expect("the name");
            ready.send(()).expect("a test");
            serve(connection, Portal::Responds(0, &["file:///a"]), tell).await
        })
    });
    is_ready.recv_timeout(PATIENCE).expect("a portal");
    assert_eq!(over(&address, told), Reply::Chosen(vec!["/a".into()]));
    daemon.kill().and_then(|()| daemon.wait()).expect("it ends");
    assert_eq!(over(&address, channel().1), Reply::Unavailable, "there is no bus");
}
