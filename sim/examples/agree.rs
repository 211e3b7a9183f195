use shakedown_sim::*; use shakedown_gripper_assets::*; use shakedown_objects::*; use rayon::prelude::*; use std::time::Instant;
fn main(){
    let root=std::path::Path::new("/work/shared/acronym/seen");
    let args:Vec<String>=std::env::args().skip(1).collect();
    let n:usize=args[0].parse().unwrap(); let pat=&args[1]; let sets=&args[2..];
    let g=Gripper::load("franka_panda").unwrap(); let p=Protocol::load("acronym",sets).unwrap();
    let mut files:Vec<_>=std::fs::read_dir(root.join("grasps")).unwrap().map(|e|e.unwrap().path()).filter(|p|pat.split(',').any(|q|p.to_str().unwrap().contains(q))).collect(); files.sort();
    let mut tot=[[0usize;2];2]; let (mut cpu,mut steps,mut trials)=(0.0,0u64,0usize); let mut labels=std::collections::BTreeMap::new();
    let mut bas=vec![];
    for f in files{
        let f=read_grasps(&f,&ReadOptions::default()).unwrap();
        let o=Object::load(&ObjectSpec{mesh:root.join(f.object.mesh.as_ref().unwrap()),scale:f.object.scale,density_kg_m3:f.object.density_kg_m3,..Default::default()}).unwrap();
        let cache=pieces::default_cache_directory();
        let s=Scene::new(&o,&g,&p,None,cache.as_deref()).unwrap();
        let st=f.grasps.len()/n; let gs:Vec<_>=f.grasps.iter().step_by(st).take(n).collect();
        let t=Instant::now();
        let r:Vec<_>=gs.par_iter().map(|q|(q.label.unwrap(),run_trial(&s,&q.object_from_hand))).collect();
        let w=t.elapsed().as_secs_f64()*2.0; cpu+=w; trials+=r.len();
        let mut c=[[0usize;2];2];
        for (l,o) in &r { c[*l as usize][o.is_held() as usize]+=1; steps+=o.steps as u64; *labels.entry((*l,o.label)).or_insert(0)+=1; }
        for i in 0..2{for j in 0..2{tot[i][j]+=c[i][j];}}
        let ba=|c:&[[usize;2];2]|0.5*(c[1][1] as f64/(c[1][0]+c[1][1]).max(1) as f64+c[0][0] as f64/(c[0][0]+c[0][1]).max(1) as f64);
        bas.push(ba(&c));
        println!("{:12} m {:.1} g parts {} TP {} FP {} TN {} FN {} BA {:.3}  {:.1} trials/cpu-s",&o.id[..12.min(o.id.len())],s.mass_kg*1e3,s.contact_parts,c[1][1],c[0][1],c[0][0],c[1][0],ba(&c),r.len() as f64/w);
    }
    let ba=0.5*(tot[1][1] as f64/(tot[1][0]+tot[1][1]) as f64+tot[0][0] as f64/(tot[0][0]+tot[0][1]) as f64);
    println!("TOTAL TP {} FP {} TN {} FN {} BA {:.3} meanBA {:.3}  trials/cpu-s {:.1} us/step {:.1}",tot[1][1],tot[0][1],tot[0][0],tot[1][0],ba,bas.iter().sum::<f64>()/bas.len() as f64,trials as f64/cpu,cpu*1e6/steps as f64);
    println!("{labels:?}");
}
