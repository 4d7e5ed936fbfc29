//! A batch: repeatable, sealed, taken up again, and silent about its labels.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use gripsight_bag::TopicMap;
use gripsight_withheld_make::{
    Batch, BatchSettings, CaseLabel, Journal, Kind, Labels, Pool, WithheldError, files,
};

fn settings(seed: u64) -> BatchSettings {
    BatchSettings {
        cases: 12,
        seed,
        pool: Pool::Development,
        duration_s: 10.0,
        foreign: None,
        recorded: None,
        simulators: None,
        compared: false,
    }
}

fn make(folder: &Path) -> (Batch, Vec<CaseLabel>) {
    let batch = Batch::new(settings(7)).unwrap();
    let labels = (0..batch.len()).map(|i| batch.make(i, folder).unwrap()).collect();
    (batch, labels)
}

fn what_drives_show(labels: &[CaseLabel]) {
    for label in labels {
        for effect in &label.effects {
            let fit = effect.oracle.unwrap();
            assert!(
                fit.severity.is_finite() && fit.severity >= 0.0 && fit.size_ratio.is_finite(),
                "{label:?}"
            );
            assert_eq!(fit.excess_without.is_some(), label.kind == Kind::Deleted);
            // A stand-in explains some of it, never more than there is.
            assert!(
                fit.excess_without.is_none_or(|left| left >= 0.0 && left <= 1.001 * fit.chi2_per_residual)
            );
            assert_eq!(label.without.contains(&effect.name), label.kind == Kind::Deleted);
        }
    }
}

#[test]
fn a_batch_is_repeatable_sealed_and_silent_and_says_what_drives_show() {
    let folder = tempfile::tempdir().unwrap();
    let (batch, labels) = make(folder.path());
    assert!(Kind::ALL.iter().all(|kind| labels.iter().any(|l| l.kind == *kind)));

    let again = tempfile::tempdir().unwrap();
    assert_eq!(batch.make(3, again.path()).unwrap(), labels[3]);
    for name in [files::BAG, files::HELD_OUT, files::VEHICLE, files::TIRES, files::WITHOUT] {
        let read = |folder: &Path| fs::read(folder.join(&labels[3].case).join(name)).unwrap();
        assert_eq!(read(folder.path()), read(again.path()), "{name}");
    }

    // Seen from outside all cases are alike: the same files, the same length, the same start, lists of one length.
    let outside = |label: &CaseLabel| {
        let case = folder.path().join(&label.case);
        let names: BTreeSet<_> = fs::read_dir(&case).unwrap().map(|e| e.unwrap().file_name()).collect();
        let info = gripsight_bag::info(&case.join(files::BAG), &TopicMap::default()).unwrap();
        let listed = fs::read_to_string(case.join(files::WITHOUT)).unwrap().lines().count();
        (names, listed, (info.duration_s * 10.0).round() as i64)
    };
    assert!(labels.iter().all(|label| outside(label) == outside(&labels[0])));

    what_drives_show(&labels);

    let sealed = folder.path().join("labels.json");
    let opened = batch.labels("nonce".to_owned(), labels.clone()).unwrap();
    opened.seal(&sealed, folder.path()).unwrap();
    assert_eq!(Labels::open(&sealed, folder.path()).unwrap(), opened);
    let text = fs::read_to_string(&sealed).unwrap();
    fs::write(&sealed, text.replacen("\"none\"", "\"pair\"", 1)).unwrap();
    let refused = Labels::open(&sealed, folder.path());
    assert!(matches!(refused, Err(WithheldError::Tampered { .. })), "{refused:?}");
}

#[test]
fn a_comparison_has_an_earlier_drive_without_what_is_to_be_found() {
    let folder = tempfile::tempdir().unwrap();
    let batch = Batch::new(BatchSettings { cases: 4, compared: true, ..settings(11) }).unwrap();
    let labels: Vec<CaseLabel> = (0..batch.len()).map(|i| batch.make(i, folder.path()).unwrap()).collect();
    assert_eq!(labels.iter().filter(|l| l.kind == Kind::None).count(), 2);
    for label in &labels {
        let case = folder.path().join(&label.case);
        assert!(label.compared && label.contained.is_empty());
        assert!(case.join(files::EARLIER).is_file() && !case.join(files::HELD_OUT).exists());
        assert_ne!(fs::read(case.join(files::EARLIER)).unwrap(), fs::read(case.join(files::BAG)).unwrap());
    }
}

#[test]
fn a_journal_is_taken_up_again_by_the_same_batch_only() {
    let folder = tempfile::tempdir().unwrap();
    let labels = folder.path().join("labels.json");
    let (mut journal, first) = Journal::open(&labels, None, settings).unwrap();
    let batch = Batch::new(first.clone()).unwrap();
    journal.note(batch.make(0, folder.path()).unwrap()).unwrap();
    let before = journal.content();
    drop(journal);
    let (journal, second) = Journal::open(&labels, None, settings).unwrap();
    assert_eq!(second, first);
    assert_eq!(journal.content(), before);
    drop(journal);
    let other = Journal::open(&labels, None, |seed| BatchSettings { cases: 13, ..settings(seed) });
    assert!(matches!(other, Err(WithheldError::OtherBatch { .. })));
}
