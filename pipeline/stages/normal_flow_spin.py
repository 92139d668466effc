"""Spin from normal flow: one linear constraint an event, first from local planes, then seen by a turning observer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..camera import Setting
from ..kernels.comoving import comoving_constraints, position_response
from ..kernels.sphere import spin_rows
from ..kernels.spin import robust_spin, sampled_spin, support
from ..results import SpinEstimate
from .flow import FlowResult
from .logo import LogoResult

if TYPE_CHECKING:
    from .spin import SpinParameters

Floats = NDArray[np.float64]
TAU = 2 * math.pi

# Fewer events than this inside the mask are the outline's leftovers and noise; a visible logo gives 100 in 10 ms.
FEWEST_EVENTS = 30
# The outline bleeds into the mask when the radius is a pixel or two wrong; only events deeper than this are surely
# not the outline's, and some must be there.
DEEP_PX, FEWEST_DEEP = 2.0, 20
# Constraints looked at in one go: neighbours overlap some twentyfold, so more say nothing new and cost time.
STARTS, CENTRES, TRIES = 400, 800, 200
# A plane's speed is good to about a quarter: the middle half of them on the samples lies within 15 %.
PLANE_SHARE = 0.25
# How far the ball may turn within the neighbourhood of an event: wide once the guess is good, and at first narrow,
# because a guess wrong by a quarter blurs lines by a quarter of the way turned.
FIRST_TURNS, NEXT_TURNS = (0.25, 0.5, 0.5), (0.5,)
# Neighbourhood and width of a line: 3 px as for the planes; a pixel and its jitter.
REACH_PX, WIDTH_PX, SHARPEST = 3.0, 1.2, 0.35
# Tracks are not better than this, whatever their filter says; speeds of curved and blurred strokes neither.
POSITION_FLOOR_PX, SPEED_FLOOR = 0.2, 0.03


@dataclass(frozen=True, slots=True)
class _Solution:
    spin: Floats
    covariance: Floats
    lines: int
    looked_at: int


class NormalFlowSpin:
    """Normal flow's spin of one shot, from all its logo events so far (those of the last spin.window_us)."""

    def __init__(self, parameters: SpinParameters, setting: Setting) -> None:
        self.parameters = parameters
        self.setting = setting
        self.t_us = np.empty(0, np.int64)
        self.on = np.empty(0, np.bool_)
        self.normals = np.empty((0, 3))
        self.sights = np.empty((0, 3))
        self.deep = np.empty(0, np.bool_)
        self.plane_t_us = np.empty(0, np.int64)
        self.plane_rows = np.empty((0, 3))
        self.plane_speeds = np.empty(0)
        self.previous: Floats | None = None
        self.position=[];self.rad=[]
        self.info={}

    def estimate(self, end_us: int, logo: LogoResult, flow: FlowResult) -> SpinEstimate:
        self._add(logo, flow)
        n = len(self.t_us)
        if n < FEWEST_EVENTS: return self.no(f'{n} logo events')
        deep=int(self.deep.sum())
        if deep<FEWEST_DEEP: return self.no(f'deep {deep}')
        stride = max(1, len(self.plane_speeds)//STARTS)
        R,S=np.ascontiguousarray(self.plane_rows[::stride]),np.ascontiguousarray(self.plane_speeds[::stride])
        if len(S)<12: return self.no('planes %d'%len(S))
        w,sup=sampled_spin(R,S,PLANE_SHARE,TAU*self.setting.max_spin_rps*1.1,TRIES,1)
        self.info=dict(sup=sup,n=n,deep=deep)
        fresh=True
        if self.previous is not None and support(R,S,self.previous,PLANE_SHARE)>=0.9*sup: w=self.previous; fresh=False
        elif sup==0: return self.no('no agreement')
        else: w,_,_,_=robust_spin(R,S,0.15*S,w,10)
        self.info['start']=w/TAU
        for turn in (FIRST_TURNS if fresh else NEXT_TURNS):
            mag=float(np.linalg.norm(w))
            if mag<1 or mag>TAU*200: self.previous=None; return self.no('wild')
            st=max(1,n//CENTRES); r=self.r
            k,rows,sp,var=comoving_constraints(self.t_us,self.normals,self.on,w,st,REACH_PX/r,turn/mag*1e6,WIDTH_PX/r,SHARPEST)
            if len(k)<12: self.previous=None; return self.no('few lines')
            cos=(self.sights[k]*self.normals[k]).sum(1)
            pos=max(np.mean(self.position),POSITION_FLOOR_PX); rad=max(np.mean(self.rad),POSITION_FLOOR_PX)
            std=np.sqrt(var+(mag*pos/r/cos)**2+(SPEED_FLOOR*mag)**2)
            w,wt,N,scale=robust_spin(rows,sp,std,w,10)
        self.previous=w
        inv=np.linalg.inv(N)
        resid=sp-rows@w
        block=(self.t_us[k]*np.linalg.norm(w)*1e-6/1.0).astype(np.int64); ub,ix=np.unique(block,return_inverse=True)
        sc=np.zeros((len(ub),3)); np.add.at(sc,ix,(wt*resid)[:,None]*rows)
        G=len(ub)
        sand=inv@(sc.T@sc)@inv*(G/(G-1) if G>1 else 1)
        D=inv@(rows*wt[:,None]).T@position_response(self.normals[k],self.sights[k],rows,w,r)
        posc=D@np.diag([pos**2,pos**2,rad**2])@D.T
        ehat=self.normals[k]
        self.info.update(lines=len(k),centres=len(range(st//2,n,st)),wsum=float((wt*std**2).sum()),scale=scale,naive=inv*max(scale,1)**2/TAU**2,sand=sand/TAU**2,posc=posc/TAU**2,G=G,D=D/TAU,N=N,
            eig=np.linalg.eigvalsh(N)/ (wt.sum()),span=(self.t_us[-1]-self.t_us[0])*1e-6*np.linalg.norm(w)/TAU)
        cov=sand+posc
        return SpinEstimate('normal_flow',w/TAU,cov/TAU**2,None,len(k))
    def no(self,why): return SpinEstimate.refused('normal_flow',why,len(self.t_us))
    def _add(self, logo, flow):
        keep=~logo.of_outline
        from types import SimpleNamespace as NS
        logo=NS(events=logo.events[keep],normals=logo.normals[keep],points_m=logo.points_m[keep],radius_px=logo.radius_px,pad_px=logo.pad_px,x_px=logo.x_px[keep],y_px=logo.y_px[keep],position_std_px=logo.position_std_px,radius_std_px=logo.radius_std_px)
        self.t_us=np.concatenate([self.t_us,logo.events.t_us]); self.normals=np.concatenate([self.normals,logo.normals]); self.on=np.concatenate([self.on,logo.events.on])
        c=logo.points_m-self.setting.ball_radius_m*logo.normals
        self.sights=np.concatenate([self.sights,-c/np.linalg.norm(c,axis=1)[:,None]])
        self.deep=np.concatenate([self.deep,logo.radius_px-logo.pad_px-np.hypot(logo.x_px,logo.y_px)>DEEP_PX])
        self.plane_rows=np.concatenate([self.plane_rows,spin_rows(flow.normal_points_m,flow.normal_normals,flow.normal_direction,self.setting.camera.focal_px,self.setting.ball_radius_m)])
        self.plane_speeds=np.concatenate([self.plane_speeds,flow.normal_speed_px_s])
        self.r=logo.radius_px; self.position.append(logo.position_std_px); self.rad.append(logo.radius_std_px)
